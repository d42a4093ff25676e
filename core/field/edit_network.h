// The body of the editable field g as one autograd function: encoding, network and outputs of the samples that are
// asked, written to where they belong among all samples.
//
// Samples are worked through in chunks (core/kernels: hash_grid_simd.h, edit_mlp_simd.h), chunks side by side; the
// gradients of the matrices are summed in the order of the chunks, those of the table in a fixed number of parts: the
// bits do not depend on the number of threads.
// Differentiable in table, weights and biases; not in positions.
#pragma once

#include <memory>
#include <vector>

#include "core/base/torch.h"
#include "core/field/geometry.h"
#include "core/kernels/edit_mlp_ref.h"
#include "core/kernels/hash_grid_ref.h"

namespace fieldgraft {

struct EditNetwork {
    HashGrid grid;
    FieldGeometry geometry;
    EditMlpShape mlp;
    std::vector<int> heads;  // how many outputs each head has
};

// One level per resolution (cells along the box's longest edge): dense while its vertices fit into 2^log2_table_size
// entries, hashed beyond. Throws std::invalid_argument for an empty list or numbers out of range.
HashGrid make_level_grid(const std::vector<int>& resolutions, int features, int log2_table_size);

// positions N×3 float32; index M int64, ascending: the samples that are asked; table entries×F; weights and biases of
// the hidden layer (H×E, H) and of the outputs (K×H, K). Each head's values, N or N×size, 0 at samples not asked.
std::vector<Tensor> edit_network(const std::shared_ptr<const EditNetwork>& network, const Tensor& positions,
                                 const Tensor& index, const Tensor& table, const Tensor& hidden_weight,
                                 const Tensor& hidden_bias, const Tensor& output_weight, const Tensor& output_bias);

}  // namespace fieldgraft
