// A small fully connected network without biases, ReLU between layers, none after the last: the plain-loop reference
// that the field's matrix-product path is tested against.
//
//   h_0 = x,  h_{i+1} = max(0, W_i h_i) for i < L−1,  y = W_{L−1} h_{L−1}
//
// Layout: W_i is row-major out_i×in_i; activations are feature-major, width×n. Sums run in order of the inputs.
// The gradient of ReLU at 0 is 0. Forward error: each sum of m products is within m ε of Σ|w h|.
#pragma once

#include <span>
#include <vector>

namespace fieldgraft {

struct MlpShape {
    std::vector<int> widths;  // input, hidden …, output: at least two
};

// activations[i] receives h_{i+1} (the last one is y), resized as needed.
template <class T>
void mlp_forward(const MlpShape& shape, const std::vector<std::span<const T>>& weights, std::span<const T> input,
                 std::vector<std::vector<T>>& activations);

// Adds to weight_grads[i] (like weights[i]); writes input_grad (like input; empty: not wanted).
template <class T>
void mlp_backward(const MlpShape& shape, const std::vector<std::span<const T>>& weights, std::span<const T> input,
                  const std::vector<std::vector<T>>& activations, std::span<const T> output_grad,
                  const std::vector<std::span<T>>& weight_grads, std::span<T> input_grad);

}  // namespace fieldgraft
