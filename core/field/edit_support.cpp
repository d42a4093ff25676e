#include "core/field/edit_support.h"

#include <algorithm>

#include "core/base/errors.h"
#include "core/field/cells.h"

namespace fieldgraft {
namespace {

constexpr std::int64_t cells_at_once = 65536;

// N: the largest of g's heads, density as optical depth over `delta`.
Tensor strongest(const EditSamples& edit, double delta, std::int64_t count) {
    Tensor most = at::zeros({count}, at::kFloat);
    if (edit.density_e.defined()) most = at::max(most, edit.density_e * delta);
    if (edit.beta_density.defined()) most = at::max(most, edit.beta_density);
    if (edit.beta_color.defined()) most = at::max(most, edit.beta_color);
    return most;
}

double density_unit(const FieldGeometry& geometry) {
    return longest_edge(geometry) / 128;
}

}  // namespace

Tensor edit_support(const EditField& edit, const Tensor& candidates, double delta, double epsilon) {
    check_cells(candidates, "the candidates of an edit's support");
    if (!(delta > 0) || !(epsilon > 0)) {
        throw std::invalid_argument(fmt::format("delta and epsilon must be positive, not {} and {}", delta, epsilon));
    }
    at::NoGradGuard no_grad;
    const int resolution = static_cast<int>(candidates.size(0));
    const Tensor cells = candidates.reshape({-1}).nonzero().squeeze(1);
    Tensor support = at::zeros({candidates.numel()}, at::kByte);
    for (std::int64_t first = 0; first < cells.size(0); first += cells_at_once) {
        const Tensor part = cells.narrow(0, first, std::min(cells_at_once, cells.size(0) - first));
        Tensor most = at::zeros({part.size(0)}, at::kFloat);
        for (int corner = 0; corner < 27; ++corner) {
            // Just inside the cell, so that rounding puts no point outside the box.
            const auto place = [](int step) { return 0.5 + 0.4999 * (step - 1); };
            const std::array<double, 3> offset{place(corner % 3), place(corner / 3 % 3), place(corner / 9)};
            const Tensor points = cell_points(edit.geometry(), resolution, part, offset);
            most = at::max(most, strongest(edit.evaluate(points), delta, part.size(0)));
        }
        support.index_copy_(0, part, most.gt(epsilon).to(at::kByte));
    }
    return support.view(candidates.sizes());
}

Tensor jitter_penalty(const EditField& field, const EditSamples& edit, const Tensor& positions, double distance,
                      Random& random) {
    if (!(distance > 0))
        throw std::invalid_argument(fmt::format("a jitter's distance must be positive, not {}", distance));
    Tensor offsets = at::empty_like(positions);
    float* values = offsets.mutable_data_ptr<float>();
    const float reach = static_cast<float>(distance);
    for (std::int64_t i = 0; i < offsets.numel(); ++i) values[i] = random.uniform(-reach, reach);
    if (positions.size(0) == 0) return at::zeros({}, at::kFloat);
    Tensor places = positions + offsets;
    for (int axis = 0; axis < 3; ++axis) {  // g ends at the box: that step is not roughness
        const FieldGeometry& box = field.geometry();
        places.select(1, axis).clamp_(box.box_min[axis], box.box_max[axis]);
    }
    const EditSamples moved = field.evaluate(places);
    const double unit = density_unit(field.geometry());
    Tensor penalty = at::zeros({}, at::kFloat);
    const auto add = [&](const Tensor& here, const Tensor& there) {
        if (here.defined() && there.defined()) penalty = penalty + (here - there).square().sum() / positions.size(0);
    };
    add(edit.color_e, moved.color_e);
    add(edit.beta_density, moved.beta_density);
    add(edit.beta_color, moved.beta_color);
    if (edit.density_e.defined()) add(at::expm1(-unit * edit.density_e), at::expm1(-unit * moved.density_e));
    return penalty;
}

}  // namespace fieldgraft
