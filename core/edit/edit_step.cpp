#include "core/edit/edit_step.h"

#include <stdexcept>

#include "core/base/progress.h"

namespace fieldgraft {

namespace {

constexpr int smooth_points = 1024;
constexpr double smooth_radius = 0.02;  // of the box's longest edge

// The text losses' gradients to the pictures; fills in the terms.
struct PictureGradients {
    Tensor blended, edit;
};

PictureGradients ask_guide(const RenderedEdit& rendered, const FrozenPatch& patch, const TextObjective& text,
                           const EditPlan& plan, const Tensor& background, Random& random, StepLosses& losses) {
    const Stopwatch watch;
    EditImages images{patch.over(background), rendered.blended.detach().requires_grad_(true), {}};
    if (plan.edit_image) images.edit = rendered.edit.detach().requires_grad_(true);
    const TextTerms terms = text.evaluate(images, background, random);
    Tensor total = at::zeros({});
    const auto add = [&](const char* name, const Tensor& term) {
        if (!term.defined()) return;
        losses.terms[name] = term.item<double>();
        losses.total += plan.weight(name) * losses.terms[name];
        total = total + plan.weight(name) * term;
    };
    add("dir", terms.dir);
    add("global", terms.global);
    add("global_edit", terms.global_edit);
    torch::autograd::variable_list wanted{images.blended};
    if (plan.edit_image) wanted.push_back(images.edit);
    const auto gradients = torch::autograd::grad({total}, wanted, {}, std::nullopt, false, true);
    losses.tower_seconds = watch.seconds();
    return {gradients[0], plan.edit_image ? gradients[1] : Tensor()};
}

}  // namespace

Tensor draw_background(EditBackground kind, Random& random) {
    if (kind == EditBackground::black) return at::zeros({3});
    if (kind == EditBackground::white || random.uniform() < 0.5f) return at::ones({3});
    return at::tensor({random.uniform(), random.uniform(), random.uniform()});
}

double threshold_of(const std::string& map, const EditSpec& spec, double position, double region_share) {
    const Thresholds& tau = spec.tau;
    double value = 0;
    if (map == "added") {
        value = annealed(tau.add_start, tau.add, position, tau.anneal_iterations);
    } else if (map == "removed") {
        value = tau.remove;
    } else if (map == "changed") {
        value = annealed(tau.change_start, tau.change, position, tau.anneal_iterations);
    } else {
        throw std::invalid_argument("threshold_of: there is no map " + map);
    }
    return tau.relative_to_region ? value * region_share : value;
}

StepLosses backward_step(const EditField& edit, const FrozenPatch& patch, const TextObjective& text,
                         const EditSpec& spec, const EditPlan& plan, double position, Random& random) {
    StepLosses losses;
    const Tensor background = draw_background(spec.background, random);
    const RenderedEdit rendered = render_edit(edit, patch, plan, {spec.compositing, spec.removed}, background);
    const PictureGradients pictures = ask_guide(rendered, patch, text, plan, background, random, losses);

    Tensor local = at::zeros({});
    const auto add = [&](const std::string& name, const Tensor& term) {
        losses.terms[name] += term.item<double>();
        losses.total += plan.weight(name) * term.item<double>();
        local = local + plan.weight(name) * term;
    };
    const double pixels = static_cast<double>(patch.size) * patch.size;
    if (plan.has("region")) {
        const double inside = spec.weight("inside") * positive_weight(patch.area, pixels, plan.positive_weight_floor);
        add("region", region_loss(rendered.map_sum(), patch.masks, inside));
    }
    if (plan.has("opacity")) {
        const auto limit = [&](const char* name, const Tensor& map) {
            if (map.defined())
                add("opacity", opacity_loss(map, threshold_of(name, spec, position, patch.area / pixels)));
        };
        limit("added", rendered.added);
        limit("removed", rendered.removed);
        limit("changed", rendered.changed);
    }
    if (plan.has("reg") && position >= spec.reg_from) add("reg", entropy_loss(rendered.added));
    if (plan.has("smooth"))
        add("smooth",
            smoothness_loss(edit, patch, smooth_radius * longest_edge(edit.geometry()), smooth_points, random));

    // The guide's gradient enters as a linear term: its own graph is already gone.
    const auto carry = [&](const Tensor& picture, const Tensor& gradient) {
        if (gradient.defined()) local = local + (picture * gradient).sum();
    };
    carry(rendered.blended, pictures.blended);
    carry(rendered.edit, pictures.edit);
    if (local.requires_grad()) local.backward();
    return losses;
}

}  // namespace fieldgraft
