// A hash-grid field as the kernels read it: no tensors, no graph.
#pragma once

#include <array>
#include <span>

#include "core/field/radiance_field.h"
#include "core/kernels/field_mlp_simd.h"
#include "core/kernels/hash_grid_ref.h"
#include "core/kernels/march_ref.h"

namespace fieldgraft {

// log density = features₀ + offset, at most the limit.
constexpr double log_density_offset = -1.0;  // density of an untrained field: e⁻¹ per model unit
constexpr double log_density_limit = 15.0;

// Holds packed copies of the networks' weights; grid, table and occupancy belong to the field, which must outlive it.
struct KernelField {
    explicit KernelField(const RadianceField& field, Precision precision = Precision::float32);

    const HashGrid* grid;
    std::span<const float> table;
    FieldMlpWeights weights;
    std::array<double, 3> box_min, box_max;
    int sh_degree;
    std::size_t encoded_row, feature_row, hidden_row, basis_row;  // padded widths
};

// Names of the networks' matrices among the field's parameters, in the kernels' order.
constexpr const char* field_matrix_names[] = {"density.0", "density.1", "color.0", "color.1", "color.2"};

// Occupied cells for marching (undefined: the whole box). Throws std::invalid_argument: not a contiguous cube of bytes.
MarchGrid march_grid_of(const FieldGeometry& geometry, const Tensor& occupancy);

}  // namespace fieldgraft
