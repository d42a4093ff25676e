#include "core/render/blended_view.h"

#include <algorithm>

#include "core/base/errors.h"
#include "core/field/cells.h"
#include "core/render/blended_pass.h"
#include "core/render/ray_ranges.h"

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

// The paper's map of what is removed sums over samples that no light comes from.
bool sums_over_hidden(const EditStack& items, const BlendedOptions& options) {
    return options.blend.removed == RemovedMap::paper &&
           std::any_of(items.begin(), items.end(), [](const StackItem& item) { return item.active().remove; });
}

std::array<Tensor*, 9> parts(BlendedRays& rays) {
    return {&rays.color, &rays.alpha,   &rays.depth,   &rays.color_edit, &rays.alpha_edit,
            &rays.added, &rays.removed, &rays.changed, &rays.edited};
}

// Two pictures' rays in their places.
BlendedRays joined(BlendedRays& a, const Tensor& at_a, BlendedRays& b, const Tensor& at_b) {
    BlendedRays out;
    const auto to = parts(out), from_a = parts(a), from_b = parts(b);
    for (std::size_t i = 0; i < to.size(); ++i) {
        std::vector<std::int64_t> shape = from_a[i]->sizes().vec();
        shape[0] = at_a.size(0) + at_b.size(0);
        *to[i] = at::empty(shape, at::kFloat).index_copy_(0, at_a, *from_a[i]).index_copy_(0, at_b, *from_b[i]);
    }
    return out;
}

BlendedRays blended_in_chunks(const RadianceField& field, const EditStack& items, const RayBundle& rays,
                              const BlendedOptions& options) {
    if (rays.size() == 0) return plain_rays(field, rays, options);
    std::vector<BlendedRays> chunks;
    for (std::int64_t first = 0; first < rays.size(); first += options.render.chunk_rays) {
        const std::int64_t n = std::min(options.render.chunk_rays, rays.size() - first);
        const RayBundle chunk{rays.origins.narrow(0, first, n), rays.directions.narrow(0, first, n)};
        chunks.push_back(blended_chunk(field, items, chunk, options));
    }
    BlendedRays out;
    const auto to = parts(out);
    for (std::size_t i = 0; i < to.size(); ++i) {
        std::vector<Tensor> pieces;
        for (BlendedRays& chunk : chunks) pieces.push_back(*parts(chunk)[i]);
        *to[i] = at::cat(pieces);
    }
    return out;
}

}  // namespace

Tensor touched_rays(const RadianceField& field, const EditStack& stack, const RayBundle& rays,
                    const MarchOptions& options) {
    check_rays(rays);
    Tensor touched = at::zeros({rays.size()}, at::kBool), cells;
    const Tensor& own = field.occupancy();
    for (const StackItem& item : active_items(stack)) {
        const Tensor& support = item.field->support();
        if (!support.defined()) return touched.fill_(true);
        Tensor acting = support;
        if (!item.active().add && own.defined()) {
            const int finer = static_cast<int>(std::max(own.size(0), support.size(0)));
            acting = resampled_cells(own, finer).bitwise_and(resampled_cells(support, finer));
        }
        cells = joined_cells(cells, acting);
    }
    if (!cells.defined()) return touched;
    const MarchGrid grid = march_grid_of(field.geometry(), cells.contiguous());
    bool* marks = touched.mutable_data_ptr<bool>();
    over_ray_ranges(field, rays, options, [&](const RayRange& range) {
        for (std::int64_t r = range.first; r < range.last; ++r) {
            float position[3], t;
            marks[r] = RayMarcher(grid, range.march, r).next(position, t);
        }
    });
    return touched;
}

BlendedRays render_blended_rays(const RadianceField& field, const EditStack& stack, const RayBundle& rays,
                                const BlendedOptions& options) {
    at::NoGradGuard no_grad;
    if (options.render.march.jitter != nullptr) throw std::invalid_argument("pictures are rendered without jitter");
    check_stack(field, stack);
    const EditStack items = active_items(stack);
    if (items.empty() && !options.color) return plain_rays(field, rays, options);
    if (options.color) return blended_in_chunks(field, items, rays, options);
    const Tensor touched = touched_rays(field, items, rays, options.render.march);
    const Tensor index = touched.nonzero().squeeze(1), rest = touched.logical_not().nonzero().squeeze(1);
    if (index.size(0) == 0) return plain_rays(field, rays, options);
    // What no edit can reach is f's own, by f's own way.
    const RayBundle reached = selected(rays, index);
    BlendedRays plain = plain_rays(field, selected(rays, rest), options);
    BlendedRays blended = sums_over_hidden(items, options)
                              ? blended_in_chunks(field, items, reached, options)
                              : draw_blended(field, items, reached, options.render.march, options.blend.compositing);
    return joined(plain, rest, blended, index);
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
