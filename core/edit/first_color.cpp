#include "core/edit/first_color.h"

#include <limits>

namespace fieldgraft {

namespace {

constexpr double opaque_depth = 64;  // of a length as long as the box's edge
constexpr float levels[] = {0.1f, 0.5f, 0.9f};

// g at a patch's acting samples, all of it in one colour.
EditSamples painted(const FrozenPatch& patch, const EditPlan& plan, const std::array<float, 3>& color, double edge) {
    const std::int64_t count = patch.samples();
    const Operations& on = plan.operations;
    EditSamples g;
    const auto at_acting = [&](double value) { return at::zeros({count}).index_fill(0, patch.acting, value); };
    if (on.add) g.density_e = at_acting(opaque_depth / edge);
    if (on.remove) g.beta_density = at::zeros({count});
    if (on.change) g.beta_color = at_acting(1);
    g.color_e = at::tensor(at::ArrayRef<float>(color)).expand({count, 3});
    return g;
}

double text_loss(const RenderedEdit& rendered, const FrozenPatch& patch, const TextObjective& text,
                 const EditPlan& plan, const Tensor& background, Random& random) {
    const TextTerms terms =
        text.evaluate({patch.over(background), rendered.blended, rendered.edit}, background, random);
    double total = 0;
    const auto add = [&](const char* name, const Tensor& term) {
        if (term.defined()) total += plan.weight(name) * term.item<double>();
    };
    add("dir", terms.dir);
    add("global", terms.global);
    add("global_edit", terms.global_edit);
    return total;
}

}  // namespace

std::vector<std::array<float, 3>> first_color_palette() {
    std::vector<std::array<float, 3>> palette;
    for (const float r : levels) {
        for (const float g : levels) {
            for (const float b : levels) palette.push_back({r, g, b});
        }
    }
    return palette;
}

std::array<float, 3> best_first_color(const std::vector<FrozenPatch>& patches, const TextObjective& text,
                                      const EditSpec& spec, const EditPlan& plan, double edge, const Random& random) {
    at::NoGradGuard no_gradients;
    const Tensor background = spec.background == EditBackground::black ? at::zeros({3}) : at::ones({3});
    std::array<float, 3> best{0.5f, 0.5f, 0.5f};  // where no loss is finite
    double least = std::numeric_limits<double>::infinity();
    for (const auto& color : first_color_palette()) {
        Random same = random;
        double loss = 0;
        for (const FrozenPatch& patch : patches) {
            const RenderedEdit rendered = render_samples(painted(patch, plan, color, edge), patch, plan,
                                                         {spec.compositing, spec.removed}, background);
            loss += text_loss(rendered, patch, text, plan, background, same);
        }
        if (loss < least) least = loss, best = color;
    }
    return best;
}

}  // namespace fieldgraft
