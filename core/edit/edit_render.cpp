#include "core/edit/edit_render.h"

#include "core/field/edit_support.h"

namespace fieldgraft {

Tensor RenderedEdit::map_sum() const {
    Tensor sum;
    for (const Tensor* map : {&added, &removed, &changed})
        if (map->defined()) sum = sum.defined() ? sum + *map : *map;
    return sum;
}

RenderedEdit render_edit(const EditField& edit, const FrozenPatch& patch, const EditPlan& plan,
                         const BlendOptions& options, const Tensor& background) {
    return render_samples(edit.evaluate(patch.positions, patch.acting), patch, plan, options, background);
}

RenderedEdit render_samples(const EditSamples& g, const FrozenPatch& patch, const EditPlan& plan,
                            const BlendOptions& options, const Tensor& background) {
    const BlendOut out = blend(patch.start, patch.delta, patch.density, patch.color, g, options);
    const auto picture = [&](const Tensor& color, const Tensor& left) {
        return (color + left.unsqueeze(1) * background).reshape({patch.size, patch.size, 3});
    };
    const auto map = [&](const Tensor& values) {
        return values.defined() ? values.reshape({patch.size, patch.size}) : values;
    };
    RenderedEdit rendered;
    rendered.blended = picture(out.color, out.transmittance);
    if (plan.edit_image) rendered.edit = picture(out.color_edit, 1 - out.alpha_edit);
    rendered.added = map(out.added);
    rendered.removed = map(out.removed);
    rendered.changed = map(out.changed);
    return rendered;
}

Tensor smoothness_loss(const EditField& edit, const FrozenPatch& patch, double distance, int count, Random& random) {
    const std::int64_t acting = patch.acting.size(0);
    if (acting == 0) return at::zeros({});
    Tensor chosen = at::empty({count}, at::kLong);
    for (int i = 0; i < count; ++i)
        chosen.data_ptr<std::int64_t>()[i] = random.below(static_cast<std::uint32_t>(acting));
    const Tensor positions = patch.positions.index_select(0, patch.acting.index_select(0, chosen));
    return jitter_penalty(edit, edit.evaluate(positions), positions, distance, random);
}

}  // namespace fieldgraft
