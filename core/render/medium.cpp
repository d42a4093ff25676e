#include "core/render/medium.h"

#include <cmath>

#include "core/base/errors.h"
#include "core/field/cells.h"

namespace fieldgraft {
namespace {

void select_rows(VisibleSamples& visible, const Tensor& index) {
    for (Tensor* rows : {&visible.samples.ray, &visible.samples.positions, &visible.samples.t, &visible.samples.delta,
                         &visible.density, &visible.features}) {
        *rows = rows->index_select(0, index);
    }
}

// start of the rows that `keep` (N bytes) marks, out of packed samples.
Tensor packed_start(const Tensor& start, const std::vector<std::uint8_t>& keep) {
    Tensor packed = at::zeros_like(start);
    const auto from = start.accessor<std::int64_t, 1>();
    auto to = packed.accessor<std::int64_t, 1>();
    for (std::int64_t r = 0; r + 1 < start.size(0); ++r) {
        std::int64_t kept = 0;
        for (std::int64_t k = from[r]; k < from[r + 1]; ++k) kept += keep[static_cast<std::size_t>(k)];
        to[r + 1] = to[r] + kept;
    }
    return packed;
}

Tensor kept_rows(const std::vector<std::uint8_t>& keep) {
    std::vector<std::int64_t> rows;
    for (std::size_t k = 0; k < keep.size(); ++k) {
        if (keep[k]) rows.push_back(static_cast<std::int64_t>(k));
    }
    return torch::tensor(rows, at::kLong);
}

// N bytes: light from in front of the sample reaches the camera (transmittance before it above the limit).
std::vector<std::uint8_t> seen(const Samples& samples, const Tensor& density, double min_transmittance) {
    const double limit = -std::log(min_transmittance);
    const auto start = samples.start.accessor<std::int64_t, 1>();
    const Tensor depths = (density * samples.delta).contiguous();
    const float* depth_of = depths.const_data_ptr<float>();
    std::vector<std::uint8_t> keep(static_cast<std::size_t>(samples.size()), 0);
    for (std::int64_t r = 0; r + 1 < samples.start.size(0); ++r) {
        double depth = 0;
        for (std::int64_t k = start[r]; k < start[r + 1] && depth <= limit; ++k) {
            keep[static_cast<std::size_t>(k)] = 1;
            depth += std::min(static_cast<double>(depth_of[k]), 1e30);
        }
    }
    return keep;
}

// σ of f with everything taken away that the items may remove, and nothing added: a bound on what can be seen.
Tensor uncovered_density(const EditStack& items, const Tensor& positions, const Tensor& density) {
    Tensor uncovered = density;
    for (const StackItem& item : items) {
        if (item.active().remove) uncovered = uncovered * (1 - evaluate(item, positions).beta_density);
    }
    return uncovered;
}

Tensor sample_colors(const RadianceField& field, const VisibleSamples& visible, const RayBundle& rays,
                     const std::vector<std::uint8_t>& lit, const SampleColor& color) {
    Tensor colors = at::zeros({visible.samples.size(), 3}, at::kFloat);
    std::vector<std::uint8_t> shown = lit;
    const float* density = visible.density.const_data_ptr<float>();
    for (std::size_t k = 0; k < shown.size(); ++k) shown[k] = shown[k] && density[k] > 0;
    const Tensor rows = kept_rows(shown);
    const Tensor directions = rays.directions.index_select(0, visible.samples.ray.index_select(0, rows));
    const Tensor features = visible.features.index_select(0, rows);
    const Tensor part = color ? color(features, visible.samples.positions.index_select(0, rows), directions)
                              : field.color(features, directions);
    return colors.index_copy_(0, rows, part);
}

}  // namespace

Operations StackItem::active() const {
    const Operations& on = field->config().operations;
    return {on.add && add > 0, on.remove && remove > 0, on.change && change > 0};
}

StackItem stack_item(const EditFile& edit) {
    return {edit.field, edit.strength_add, edit.strength_remove, edit.strength_change};
}

void check_stack(const RadianceField& field, const EditStack& stack) {
    for (const StackItem& item : stack) {
        if (!item.field) throw std::invalid_argument("an item of the stack has no edit");
        for (const float strength : {item.add, item.remove, item.change}) {
            if (!(strength >= 0 && strength <= 1)) {
                throw std::invalid_argument(fmt::format("a strength must lie in [0, 1], not {}", strength));
            }
        }
        const FieldGeometry &own = item.field->geometry(), &f = field.geometry();
        if (own.box_min != f.box_min || own.box_max != f.box_max) {
            throw std::invalid_argument("an edit's box is not the field's: it was made for another field");
        }
    }
}

EditStack active_items(const EditStack& stack) {
    EditStack active;
    for (const StackItem& item : stack) {
        if (item.active().any()) active.push_back(item);
    }
    return active;
}

EditSamples evaluate(const StackItem& item, const Tensor& positions) {
    const Operations on = item.active();
    EditSamples edit = item.field->evaluate(positions);
    const auto scaled = [](const Tensor& head, bool kept, float strength) {
        return !kept ? Tensor() : strength == 1 ? head : head * strength;
    };
    edit.density_e = scaled(edit.density_e, on.add, item.add);
    edit.beta_density = scaled(edit.beta_density, on.remove, item.remove);
    edit.beta_color = scaled(edit.beta_color, on.change, item.change);
    if (!on.add && !on.change) edit.color_e = Tensor();
    return edit;
}

Medium blended_medium(const Medium& below, const EditSamples& edit) {
    Medium out = below;
    if (edit.beta_color.defined()) {
        const Tensor beta = edit.beta_color.unsqueeze(1);
        out.color = (1 - beta) * below.color + beta * edit.color_e;
    }
    if (edit.beta_density.defined()) out.density = (1 - edit.beta_density) * below.density;
    if (edit.density_e.defined()) {
        const Tensor both = out.density + edit.density_e;
        // The share of g, without 0/0, and exactly 0 where g is 0.
        const Tensor share =
            at::where(edit.density_e > 0, 1 / (1 + out.density / edit.density_e), at::zeros_like(both));
        out.color = out.color + share.unsqueeze(1) * (edit.color_e - out.color);
        out.density = both;
    }
    return out;
}

EditCells edit_cells(const EditStack& items) {
    EditCells cells;
    for (const StackItem& item : items) {
        const Tensor& own = item.field->support();
        const Tensor support = own.defined() ? own : at::ones({1, 1, 1}, at::kByte);
        if (item.active().add) cells.extra = joined_cells(cells.extra, support);
        if (item.active().remove) cells.transparent = joined_cells(cells.transparent, support);
    }
    return cells;
}

MediumSamples sample_stack(const RadianceField& field, const EditStack& stack, const RayBundle& rays,
                           const MediumOptions& options) {
    at::NoGradGuard no_grad;
    check_stack(field, stack);
    const EditStack items = active_items(stack);
    const EditCells cells = edit_cells(items);
    const bool removes = cells.transparent.defined();
    MarchOptions march_options = options.march;
    if (removes && options.keep_hidden) march_options.min_transmittance = 0;
    VisibleSamples visible = sample_visible(field, rays, march_options, cells);
    std::vector<std::uint8_t> lit(static_cast<std::size_t>(visible.samples.size()), 1);
    if (removes) {
        const Tensor uncovered = uncovered_density(items, visible.samples.positions, visible.density);
        lit = seen(visible.samples, uncovered, options.march.min_transmittance);
        if (!options.keep_hidden) {
            const Tensor start = packed_start(visible.samples.start, lit);
            select_rows(visible, kept_rows(lit));
            visible.samples.start = start;
            lit.assign(static_cast<std::size_t>(visible.samples.size()), 1);
        }
    }
    return {visible.samples, visible.density, sample_colors(field, visible, rays, lit, options.color)};
}

}  // namespace fieldgraft
