#include "core/render/blended_view.h"

#include "core/base/errors.h"
#include "core/field/cells.h"

namespace fieldgraft {
namespace {

RayBundle selected(const RayBundle& rays, const Tensor& index) {
    return {rays.origins.index_select(0, index), rays.directions.index_select(0, index)};
}

BlendedRays plain_rays(const RadianceField& field, const RayBundle& rays, const BlendedOptions& options) {
    const RenderedRays plain = render_rays(field, rays, options.render);
    const std::int64_t count = rays.size();
    const auto nothing = [&] { return at::zeros({count}, at::kFloat); };
    return {plain.color, plain.alpha, plain.depth, at::zeros({count, 3}, at::kFloat), nothing(), nothing(),
            nothing(),   nothing(),   nothing()};
}

// One chunk, all of it blended, level after level.
BlendedRays blended_chunk(const RadianceField& field, const EditStack& items, const RayBundle& rays,
                          const BlendedOptions& options) {
    MediumOptions medium_options;
    medium_options.march = options.render.march;
    medium_options.keep_hidden = options.blend.removed == RemovedMap::paper;
    medium_options.color = options.color;
    // The lowest medium with samples for all levels: items are asked one at a time below.
    const MediumSamples base = sample_stack(field, items, rays, medium_options);
    const Samples& samples = base.samples;
    const auto or_zeros = [&](const Tensor& map) { return map.defined() ? map : at::zeros({rays.size()}, at::kFloat); };

    BlendedRays out;
    out.edited = at::zeros({rays.size()}, at::kFloat);
    Medium medium{base.density, base.color};
    for (const StackItem& item : items) {
        const EditSamples edit = evaluate(item, samples.positions);
        const BlendOut level = blend(samples.start, samples.delta, medium.density, medium.color, edit, options.blend);
        out.color = level.color;
        out.alpha = 1 - level.transmittance;
        out.color_edit = level.color_edit.defined() ? level.color_edit : at::zeros({rays.size(), 3}, at::kFloat);
        out.alpha_edit = or_zeros(level.alpha_edit);
        out.added = or_zeros(level.added);
        out.removed = or_zeros(level.removed);
        out.changed = or_zeros(level.changed);
        out.edited = out.edited + out.added + out.removed + out.changed;
        medium = blended_medium(medium, edit);
    }
    out.edited.clamp_(0, 1);
    const CompositeOut last = composite(samples.start, samples.delta, samples.t, medium.density, medium.color);
    out.depth = last.depth;
    if (items.empty()) {
        out = {last.color,   1 - last.transmittance, last.depth,   at::zeros({rays.size(), 3}, at::kFloat),
               or_zeros({}), or_zeros({}),           or_zeros({}), or_zeros({}),
               out.edited};
    }
    return out;
}

std::array<Tensor*, 9> parts(BlendedRays& rays) {
    return {&rays.color, &rays.alpha,   &rays.depth,   &rays.color_edit, &rays.alpha_edit,
            &rays.added, &rays.removed, &rays.changed, &rays.edited};
}

}  // namespace

Tensor touched_rays(const RadianceField& field, const EditStack& stack, const RayBundle& rays,
                    const MarchOptions& options) {
    const EditStack items = active_items(stack);
    Tensor touched = at::zeros({rays.size()}, at::kBool);
    if (items.empty()) return touched;
    const Tensor& occupancy = field.occupancy();
    Tensor visited = occupancy;
    for (const StackItem& item : items) {
        if (!item.field->support().defined()) return at::ones({rays.size()}, at::kBool);
        if (!item.active().add || !visited.defined()) continue;
        visited = union_of(visited, resampled_cells(item.field->support(), static_cast<int>(occupancy.size(0))));
    }
    const Samples samples = march(field.geometry(), visited, rays, options);
    Tensor inside = at::zeros({samples.size()}, at::kBool);
    for (const StackItem& item : items) {
        inside.logical_or_(in_cells(field.geometry(), item.field->support(), samples.positions));
    }
    return touched.index_fill_(0, samples.ray.index_select(0, inside.nonzero().squeeze(1)), true);
}

BlendedRays render_blended_rays(const RadianceField& field, const EditStack& stack, const RayBundle& rays,
                                const BlendedOptions& options) {
    at::NoGradGuard no_grad;
    if (options.render.march.jitter != nullptr) throw std::invalid_argument("pictures are rendered without jitter");
    check_stack(field, stack);
    const EditStack items = active_items(stack);
    BlendedRays out = plain_rays(field, rays, options);
    if (items.empty() && !options.color) return out;
    const std::int64_t count = rays.size();
    for (std::int64_t first = 0; first < count; first += options.render.chunk_rays) {
        const std::int64_t n = std::min(options.render.chunk_rays, count - first);
        const RayBundle chunk{rays.origins.narrow(0, first, n), rays.directions.narrow(0, first, n)};
        const Tensor touched =
            options.color ? at::ones({n}, at::kBool) : touched_rays(field, items, chunk, options.render.march);
        const Tensor index = touched.nonzero().squeeze(1);
        if (index.size(0) == 0) continue;
        BlendedRays part = blended_chunk(field, items, selected(chunk, index), options);
        const auto from = parts(part), to = parts(out);
        for (std::size_t i = 0; i < to.size(); ++i) to[i]->index_copy_(0, index + first, *from[i]);
    }
    return out;
}

BlendedRays render_blended_view(const RadianceField& field, const EditStack& stack, const RayBundle& rays, int height,
                                int width, const BlendedOptions& options) {
    if (height < 1 || width < 1 || rays.size() != static_cast<std::int64_t>(height) * width) {
        throw std::invalid_argument(fmt::format("{} rays are not a view of {}×{} pixels", rays.size(), width, height));
    }
    BlendedRays out = render_blended_rays(field, stack, rays, options);
    for (Tensor* part : parts(out)) {
        *part = part->dim() == 2 ? part->view({height, width, 3}) : part->view({height, width});
    }
    return out;
}

}  // namespace fieldgraft
