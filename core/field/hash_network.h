// The hash-grid backbone's networks as autograd functions (Müller et al. 2022, sec. 5.4), the body of RadianceField.
//
//   features = W₁ relu(W₀ encode(x))            density = exp(min(features₀ − 1, 15)), 0 outside the box
//   color = sigmoid(V₂ relu(V₁ relu(V₀ [Y(d); features])))
//
// Positions N×3 in model coordinates, directions N×3 unit vectors, features N×F, all float32 on the CPU.
// Samples are worked through in chunks, one thread each (core/kernels: field_mlp_simd.h, hash_grid_simd.h), chunks side
// by side; weight gradients are summed in the order of the chunks: the bits do not depend on the number of threads.
// Samples of a ray that follow each other share what their direction adds to the colour network's first layer.
// Differentiable in table, weights and features; not in positions and directions. The gradient of density to its
// logarithm is density, at the clamp too, so that a step can leave it.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "core/base/torch.h"
#include "core/field/geometry.h"
#include "core/kernels/hash_grid_ref.h"

namespace fieldgraft {

struct HashNetwork {
    HashGrid grid;
    std::array<double, 3> box_min{}, box_max{};
    int sh_degree = 4;
};

struct DensityFeatures {
    Tensor density, features;
};

// table entries×F, weights[0] hidden×rows, weights[1] features×hidden.
DensityFeatures hash_density(const std::shared_ptr<const HashNetwork>& network, const Tensor& positions,
                             const Tensor& table, const std::vector<Tensor>& weights);

// weights: hidden×(sh² + F), hidden×hidden, 3×hidden.
Tensor hash_color(int sh_degree, const Tensor& features, const Tensor& directions, const std::vector<Tensor>& weights);

}  // namespace fieldgraft
