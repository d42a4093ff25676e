#include "core/kernels/mlp_ref.h"

#include <stdexcept>
#include <string>

namespace fieldgraft {
namespace {

template <class T, class Weights>
std::size_t check_shapes(const MlpShape& shape, const Weights& weights, std::span<const T> input) {
    const auto& widths = shape.widths;
    if (widths.size() < 2 || weights.size() + 1 != widths.size()) {
        throw std::invalid_argument("mlp: " + std::to_string(weights.size()) + " weight matrices for " +
                                    std::to_string(widths.size()) + " widths");
    }
    for (std::size_t i = 0; i < weights.size(); ++i) {
        if (weights[i].size() != static_cast<std::size_t>(widths[i]) * widths[i + 1]) {
            throw std::invalid_argument("mlp: matrix " + std::to_string(i) + " has the wrong size");
        }
    }
    const std::size_t n = input.size() / widths[0];
    if (n * widths[0] != input.size()) throw std::invalid_argument("mlp: the input is not a whole number of samples");
    return n;
}

// out (rows×n) = W (rows×columns) · in (columns×n), sums in order of the columns.
template <class T>
void multiply(std::span<const T> weight, const T* in, int rows, int columns, std::size_t n, T* out) {
    for (int r = 0; r < rows; ++r) {
        T* row = out + r * n;
        for (std::size_t s = 0; s < n; ++s) row[s] = 0;
        for (int c = 0; c < columns; ++c) {
            const T w = weight[static_cast<std::size_t>(r) * columns + c];
            for (std::size_t s = 0; s < n; ++s) row[s] += w * in[c * n + s];
        }
    }
}

}  // namespace

template <class T>
void mlp_forward(const MlpShape& shape, const std::vector<std::span<const T>>& weights, std::span<const T> input,
                 std::vector<std::vector<T>>& activations) {
    const std::size_t n = check_shapes<T>(shape, weights, input);
    const std::size_t layers = weights.size();
    activations.resize(layers);
    const T* in = input.data();
    for (std::size_t i = 0; i < layers; ++i) {
        activations[i].resize(shape.widths[i + 1] * n);
        multiply<T>(weights[i], in, shape.widths[i + 1], shape.widths[i], n, activations[i].data());
        if (i + 1 < layers) {
            for (T& value : activations[i]) value = value > 0 ? value : T(0);
        }
        in = activations[i].data();
    }
}

template <class T>
void mlp_backward(const MlpShape& shape, const std::vector<std::span<const T>>& weights, std::span<const T> input,
                  const std::vector<std::vector<T>>& activations, std::span<const T> output_grad,
                  const std::vector<std::span<T>>& weight_grads, std::span<T> input_grad) {
    const std::size_t n = check_shapes<T>(shape, weights, input);
    check_shapes<T>(shape, weight_grads, input);
    std::vector<T> grad(output_grad.begin(), output_grad.end()), below;
    for (std::size_t i = weights.size(); i-- > 0;) {
        const int rows = shape.widths[i + 1], columns = shape.widths[i];
        const T* in = i == 0 ? input.data() : activations[i - 1].data();
        below.assign(columns * n, T(0));
        for (int r = 0; r < rows; ++r) {
            const T* upper = grad.data() + r * n;
            for (int c = 0; c < columns; ++c) {
                const std::size_t w = static_cast<std::size_t>(r) * columns + c;
                T sum = 0;
                for (std::size_t s = 0; s < n; ++s) {
                    sum += upper[s] * in[c * n + s];
                    below[c * n + s] += weights[i][w] * upper[s];
                }
                weight_grads[i][w] += sum;
            }
        }
        if (i > 0) {
            for (std::size_t k = 0; k < below.size(); ++k) below[k] = in[k] > 0 ? below[k] : T(0);
        }
        grad.swap(below);
    }
    if (!input_grad.empty()) std::copy(grad.begin(), grad.end(), input_grad.begin());
}

#define FIELDGRAFT_INSTANTIATE(T)                                                                              \
    template void mlp_forward<T>(const MlpShape&, const std::vector<std::span<const T>>&, std::span<const T>,  \
                                 std::vector<std::vector<T>>&);                                                \
    template void mlp_backward<T>(const MlpShape&, const std::vector<std::span<const T>>&, std::span<const T>, \
                                  const std::vector<std::vector<T>>&, std::span<const T>,                      \
                                  const std::vector<std::span<T>>&, std::span<T>);
FIELDGRAFT_INSTANTIATE(float)
FIELDGRAFT_INSTANTIATE(double)
#undef FIELDGRAFT_INSTANTIATE

}  // namespace fieldgraft
