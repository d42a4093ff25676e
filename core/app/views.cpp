#include "core/app/views.h"

#include "core/field/diffuse_color.h"

namespace fieldgraft::app {

void add_picture_flags(CLI::App* app, PictureOptions& options) {
    app->add_option("--background", options.background,
                    "white, black, transparent, or scene: what its pictures show where nothing is")
        ->check(CLI::IsMember({"scene", "white", "black", "transparent"}));
    app->add_option("--compositing", options.compositing, "paper, or conserving (what a baked volume shows)")
        ->check(CLI::IsMember({"paper", "conserving"}));
    app->add_option("--color", options.color, "view, or diffuse: the view-independent colour that a bake stores")
        ->check(CLI::IsMember({"view", "diffuse"}));
    app->add_option("--quality", options.quality, "draft, preview or final: how finely rays are sampled")
        ->check(CLI::IsMember({"draft", "preview", "final"}));
    app->add_option("--scale", options.scale, "picture size relative to the camera's")->check(CLI::Range(0.01, 16.0));
}

BlendedOptions blended_options(const RadianceField& field, const PictureOptions& options) {
    BlendedOptions result;
    MarchOptions& march = result.render.march;
    if (options.quality != "final") {
        march.step = march_step(field.geometry(), march) * (options.quality == "draft" ? 4 : 2);
        march.min_transmittance = 0.03;
    }
    result.blend.compositing = options.compositing == "paper" ? Compositing::paper : Compositing::conserving;
    result.blend.removed = RemovedMap::visible;  // step-independent: what a user is shown
    if (options.color == "diffuse")
        result.color = [&field](const Tensor& features, const Tensor&, const Tensor&) {
            return diffuse_color(field, features);
        };
    return result;
}

Picture draw_picture(const FieldWithEdits& scene, const Camera& camera, const PictureOptions& options) {
    EditStack stack;
    for (const EditFile& edit : scene.edits) stack.push_back(stack_item(edit));
    const Camera view = scaled(camera, options.scale);
    const Rays rays = rays_of_view(view);
    const BlendedRays drawn = render_blended_view(*scene.field, stack, {rays.origins, rays.directions}, view.height,
                                                  view.width, blended_options(*scene.field, options));
    return {drawn.color, drawn.alpha, drawn.added, drawn.removed, drawn.changed};
}

Tensor with_background(const Picture& picture, const Tensor& color) {
    const Tensor alpha = picture.alpha.unsqueeze(-1);
    if (color.defined()) return picture.color + (1 - alpha) * color;
    return torch::cat({picture.color / alpha.clamp_min(1e-6), alpha}, -1);
}

}  // namespace fieldgraft::app
