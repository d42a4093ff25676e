#include "core/edit/base_medium.h"

#include "core/base/errors.h"
#include "core/edit/ray_sums.h"
#include "core/field/cells.h"

namespace fieldgraft {

namespace {

constexpr std::int64_t most_rays = 4096;  // at once: bounds the memory of a march through everything

// The samples `kept` (indices, ascending), repacked.
Samples subset(const Samples& samples, const Tensor& kept) {
    const std::int64_t rays = samples.start.size(0) - 1;
    const Tensor ray = samples.ray.index_select(0, kept);
    const Tensor counts = at::bincount(ray, {}, rays);
    const Tensor start = at::cat({at::zeros({1}, at::kLong), at::cumsum(counts, 0)});
    return {start, ray, samples.positions.index_select(0, kept), samples.t.index_select(0, kept),
            samples.delta.index_select(0, kept)};
}

Tensor kept_only(const Tensor& values, const Tensor& kept) {
    return values.defined() ? values.index_select(0, kept) : Tensor();
}

EditSamples subset(const EditSamples& edit, const Tensor& kept) {
    return {kept_only(edit.density_e, kept), kept_only(edit.color_e, kept), kept_only(edit.beta_density, kept),
            kept_only(edit.beta_color, kept)};
}

// Transmittance before each sample of whatever the edit cannot take away.
Tensor lasting_transmittance(const Samples& samples, const Tensor& density, const Tensor& acting, bool removable) {
    const Tensor lasting = removable ? density * acting.logical_not() : density;
    return transmittance_before(samples.start, samples.ray, samples.delta, lasting);
}

BaseSamples joined(std::vector<BaseSamples>& parts) {
    if (parts.size() == 1) return parts[0];
    std::vector<Tensor> start{at::zeros({1}, at::kLong)}, ray, positions, t, delta, density, color, acting;
    std::int64_t samples = 0, rays = 0;
    for (const BaseSamples& part : parts) {
        start.push_back(part.samples.start.slice(0, 1) + samples);
        ray.push_back(part.samples.ray + rays);
        positions.push_back(part.samples.positions);
        t.push_back(part.samples.t);
        delta.push_back(part.samples.delta);
        density.push_back(part.density);
        color.push_back(part.color);
        acting.push_back(part.acting);
        samples += part.samples.size();
        rays += part.samples.start.size(0) - 1;
    }
    return {{at::cat(start), at::cat(ray), at::cat(positions), at::cat(t), at::cat(delta)},
            at::cat(density),
            at::cat(color),
            at::cat(acting)};
}

}  // namespace

BaseMedium::BaseMedium(std::shared_ptr<const RadianceField> field, const std::vector<EditFile>& stack)
    : field_(std::move(field)), field_hash_(field_->hash()) {
    at::NoGradGuard no_gradients;
    occupancy_ = field_->occupancy();
    if (!occupancy_.defined()) input_error("the field has no occupancy grid: train it first");
    for (const EditFile& edit : stack) {
        edit.check_field(field_hash_, "an edit below this one");
        stack_.push_back(stack_item(edit));
        stack_hashes_.push_back(edit.hash());
        if (stack_.back().active().add && edit.field->support().defined())
            occupancy_ =
                union_of(occupancy_, resampled_cells(edit.field->support(), static_cast<int>(occupancy_.size(0))));
    }
    check_stack(*field_, stack_);
}

BaseSamples BaseMedium::sample(const RayBundle& rays, const BaseQuery& query) const {
    at::NoGradGuard no_gradients;
    EditCells cells = edit_cells(active_items(stack_));
    if (query.extra_cells.defined()) cells.extra = joined_cells(cells.extra, query.extra_cells);
    if (query.removable) {
        const Tensor everywhere = at::ones({1, 1, 1}, at::kByte);
        cells.transparent =
            joined_cells(cells.transparent, query.acting_cells.defined() ? query.acting_cells : everywhere);
    }
    cells.extra_stride = query.extra_stride;
    std::vector<BaseSamples> parts;
    for (std::int64_t first = 0; first == 0 || first < rays.size(); first += most_rays)
        parts.push_back(sample_some(
            {rays.origins.slice(0, first, first + most_rays), rays.directions.slice(0, first, first + most_rays)},
            query, cells));
    return joined(parts);
}

BaseSamples BaseMedium::sample_some(const RayBundle& rays, const BaseQuery& query, const EditCells& cells) const {
    const auto [all, density_o, features] = sample_visible(*field_, rays, query.march, cells);
    std::vector<EditSamples> edits;
    Tensor density = density_o;
    for (const StackItem& item : stack_) {
        edits.push_back(evaluate(item, all.positions));
        if (edits.back().beta_density.defined()) density = density * (1 - edits.back().beta_density);
        if (edits.back().density_e.defined()) density = density + edits.back().density_e;
    }
    const Tensor acting = query.acting_cells.defined() ? in_cells(geometry(), query.acting_cells, all.positions)
                                                       : at::ones({all.size()}, at::kBool);
    // Where nothing is and nothing can be added, nothing needs to be composited.
    Tensor useful = density * all.delta > 1e-6;
    if (query.extra_cells.defined()) useful = useful.logical_or(in_cells(geometry(), query.extra_cells, all.positions));
    const Tensor lasting = lasting_transmittance(all, density, acting, query.removable);
    const Tensor kept = useful.logical_and(lasting > query.march.min_transmittance).nonzero().squeeze(1);

    const Samples samples = subset(all, kept);
    Medium medium{density_o.index_select(0, kept), at::zeros({samples.size(), 3})};
    // Where f has no density its colour enters nowhere.
    const Tensor dense = (medium.density > 0).nonzero().squeeze(1);
    const Tensor directions = rays.directions.index_select(0, samples.ray.index_select(0, dense));
    medium.color.index_copy_(0, dense,
                             field_->color(features.index_select(0, kept.index_select(0, dense)), directions));
    for (const EditSamples& edit : edits) medium = blended_medium(medium, subset(edit, kept));
    return {samples, medium.density, medium.color, acting.index_select(0, kept)};
}

}  // namespace fieldgraft
