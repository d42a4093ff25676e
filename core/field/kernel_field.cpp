#include "core/field/kernel_field.h"

#include <stdexcept>

#include "core/base/shape.h"
#include "core/base/spans.h"
#include "core/field/hash_network.h"

namespace fieldgraft {

KernelField::KernelField(const RadianceField& field, Precision precision)
    : grid(&field.network().grid),
      table(values(field.parameters().at("encoding.table"))),
      weights(field.mlp_shape(), precision),
      box_min(field.geometry().box_min),
      box_max(field.geometry().box_max),
      sh_degree(field.config().sh_degree),
      encoded_row(padded(weights.shape().encoded)),
      feature_row(padded(weights.shape().features)),
      hidden_row(padded(weights.shape().color_hidden)),
      basis_row(padded(weights.shape().basis)) {
    FieldMlpMatrices matrices;
    for (const char* name : field_matrix_names) matrices.push_back(values(field.parameters().at(name)));
    weights.pack(matrices);
}

MarchGrid march_grid_of(const FieldGeometry& geometry, const Tensor& occupancy) {
    if (!occupancy.defined()) return make_march_grid(geometry.box_min, geometry.box_max, 0, {});
    if (occupancy.dim() != 3 || occupancy.scalar_type() != at::kByte || !occupancy.is_contiguous() ||
        occupancy.size(0) != occupancy.size(1) || occupancy.size(1) != occupancy.size(2)) {
        throw std::invalid_argument("occupancy must be a cube of bytes, not " + shape_text(occupancy));
    }
    return make_march_grid(geometry.box_min, geometry.box_max, static_cast<int>(occupancy.size(0)),
                           {occupancy.const_data_ptr<std::uint8_t>(), static_cast<std::size_t>(occupancy.numel())});
}

}  // namespace fieldgraft
