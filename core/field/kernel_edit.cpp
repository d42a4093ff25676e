#include "core/field/kernel_edit.h"

#include <algorithm>

#include "core/base/spans.h"
#include "core/field/cells.h"
#include "core/kernels/hash_grid_simd.h"

namespace fieldgraft {
namespace {

constexpr std::size_t chunk_acting = 1024;

EditMlpWeights packed_weights(const EditNetwork& network, const EditMatrices& m) {
    at::NoGradGuard no_grad;
    const Tensor weight = m.hidden_weight.contiguous(), output = m.output_weight.contiguous(),
                 bias = m.output_bias.contiguous();
    return {network.mlp, {values(weight), values(m.hidden_bias), values(output), values(bias)}};
}

}  // namespace

UnitCells::UnitCells(const FieldGeometry& geometry, const Tensor& grid) {
    if (!grid.defined()) return;
    check_cells(grid, "the grid");
    const Tensor cells = grid.contiguous();
    marks_.assign(cells.const_data_ptr<std::uint8_t>(), cells.const_data_ptr<std::uint8_t>() + cells.numel());
    resolution_ = grid.size(0);
    for (int c = 0; c < 3; ++c) {
        const double edges = longest_edge(geometry) / (geometry.box_max[c] - geometry.box_min[c]);
        cells_[c] = static_cast<float>(edges * static_cast<double>(resolution_));
    }
}

bool UnitCells::holds(float x, float y, float z) const {
    if (resolution_ == 0) return true;
    const float at[3] = {x, y, z};
    std::int64_t cell = 0;
    for (int axis = 2; axis >= 0; --axis) {
        // Samples lie in the box up to rounding.
        const auto place = static_cast<std::int64_t>(at[axis] * cells_[axis]);
        cell = cell * resolution_ + std::clamp<std::int64_t>(place, 0, resolution_ - 1);
    }
    return marks_[cell] != 0;
}

KernelEdit::KernelEdit(const EditField& edit, const Strengths& strengths)
    : network_(&edit.network()),
      table_(edit.matrices().table.contiguous()),
      weights_(packed_weights(edit.network(), edit.matrices())),
      support_(edit.geometry(), edit.support()) {
    // In the order of the network's outputs (EditField).
    const Operations& on = edit.config().operations;
    const bool adds = on.add && strengths.add > 0, changes = on.change && strengths.change > 0;
    const auto output = [&](bool exists, bool wanted, std::size_t place, float strength) {
        if (exists) outputs_.push_back({place, wanted, strength});
    };
    output(on.add, adds, density_e, strengths.add);
    for (std::size_t c = 0; c < 3; ++c) output(on.add || on.change, adds || changes, color_e + c, 1);
    output(on.remove, strengths.remove > 0, beta_density, strengths.remove);
    output(on.change, changes, beta_color, strengths.change);
}

void KernelEdit::evaluate(const float* positions, std::size_t n, float* rows, std::size_t stride) const {
    std::vector<std::int64_t> acting;
    for (std::size_t s = 0; s < n; ++s) {
        if (support_.holds(positions[s], positions[n + s], positions[2 * n + s]))
            acting.push_back(static_cast<std::int64_t>(s));
    }
    EditColumns<float> columns;
    for (std::size_t k = 0; k < outputs_.size(); ++k) {
        columns.data[k] = outputs_[k].wanted ? rows + outputs_[k].place : nullptr;
        columns.step[k] = stride;
    }
    const std::size_t encoded_row = static_cast<std::size_t>(weights_.row());
    std::vector<float> unit(3 * chunk_acting), encoded(encoded_row * chunk_acting);
    for (std::size_t first = 0; first < acting.size(); first += chunk_acting) {
        const std::size_t count = std::min(chunk_acting, acting.size() - first);
        for (std::size_t c = 0; c < 3; ++c) {
            for (std::size_t i = 0; i < count; ++i) unit[c * count + i] = positions[c * n + acting[first + i]];
        }
        hash_grid_encode(network_->grid, values(table_), unit.data(), count, encoded.data(), encoded_row);
        for (std::size_t i = 0; i < count; ++i)
            encoded[i * encoded_row + network_->grid.rows()] = 1;  // the bias' input
        columns.index = acting.data() + first;
        edit_mlp_forward(weights_, encoded.data(), static_cast<int>(count), columns);
    }
    for (const Output& output : outputs_) {
        if (!output.wanted || output.strength == 1) continue;
        for (const std::int64_t s : acting) rows[s * stride + output.place] *= output.strength;
    }
}

}  // namespace fieldgraft
