#include "core/field/kernel_field.h"

#include "core/base/spans.h"
#include "core/field/hash_network.h"

namespace fieldgraft {

KernelField::KernelField(const RadianceField& field)
    : grid(&field.network().grid),
      table(values(field.parameters().at("encoding.table"))),
      weights(field.mlp_shape()),
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

MarchGrid march_grid_of(const RadianceField& field) {
    const FieldGeometry& geometry = field.geometry();
    const Tensor& cells = field.occupancy();
    if (!cells.defined()) return make_march_grid(geometry.box_min, geometry.box_max, 0, {});
    return make_march_grid(geometry.box_min, geometry.box_max, static_cast<int>(cells.size(0)),
                           {cells.const_data_ptr<std::uint8_t>(), static_cast<std::size_t>(cells.numel())});
}

}  // namespace fieldgraft
