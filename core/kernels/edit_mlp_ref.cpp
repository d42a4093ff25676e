#include "core/kernels/edit_mlp_ref.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace fieldgraft {

namespace {

// One sample's hidden layer and z.
template <class T>
struct Sample {
    std::vector<T> hidden, z;

    Sample(const EditMlpShape& shape, const EditMlpMatrices<const T>& m, const T* e)
        : hidden(shape.hidden), z(shape.outputs.size()) {
        for (int h = 0; h < shape.hidden; ++h) {
            T sum = m.hidden_bias[h];
            for (int i = 0; i < shape.encoded; ++i) sum += m.hidden[h * shape.encoded + i] * e[i];
            hidden[h] = std::max(T(0), sum);
        }
        for (std::size_t k = 0; k < z.size(); ++k) {
            z[k] = m.output_bias[k];
            for (int h = 0; h < shape.hidden; ++h) z[k] += m.output[k * shape.hidden + h] * hidden[h];
        }
    }
};

template <class T>
T activated(const EditMlpShape& shape, std::size_t k, T z) {
    if (shape.outputs[k] == EditActivation::softplus)
        return T(shape.density_scale) * (std::max(z, T(0)) + std::log1p(std::exp(-std::abs(z))));
    return 1 / (1 + std::exp(-T(bounded_logit) * std::tanh(z / T(bounded_logit))));
}

template <class T>
T slope(const EditMlpShape& shape, std::size_t k, T z) {
    if (shape.outputs[k] == EditActivation::softplus) return T(shape.density_scale) / (1 + std::exp(-z));
    // 1 − t² is 4q/(1 + q)², and 1 − y is y e: no cancellation where t or y is near 1.
    const T q = std::exp(-2 * std::abs(z / T(bounded_logit))), y = activated(shape, k, z);
    const T e = std::exp(-T(bounded_logit) * std::tanh(z / T(bounded_logit)));
    return y * y * e * (4 * q / ((1 + q) * (1 + q)));
}

}  // namespace

void EditMlpShape::check() const {
    if (encoded < 1 || encoded > 4096 || hidden < 1 || hidden > 4096 || outputs.empty() || outputs.size() > 16) {
        throw std::invalid_argument("edit mlp: widths must be 1 to 4096 and outputs 1 to 16, not " +
                                    std::to_string(encoded) + ", " + std::to_string(hidden) + " and " +
                                    std::to_string(outputs.size()));
    }
}

template <class T>
void edit_mlp_forward(const EditMlpShape& shape, const EditMlpMatrices<const T>& matrices, std::span<const T> encoded,
                      std::span<T> y) {
    const std::size_t outputs = shape.outputs.size(), n = y.size() / outputs;
    for (std::size_t s = 0; s < n; ++s) {
        const Sample<T> sample(shape, matrices, encoded.data() + s * shape.encoded);
        for (std::size_t k = 0; k < outputs; ++k) y[s * outputs + k] = activated(shape, k, sample.z[k]);
    }
}

template <class T>
void edit_mlp_backward(const EditMlpShape& shape, const EditMlpMatrices<const T>& matrices, std::span<const T> encoded,
                       std::span<const T> y_grad, const EditMlpMatrices<T>& gradients, std::span<T> encoded_grad) {
    const std::size_t outputs = shape.outputs.size(), n = y_grad.size() / outputs;
    std::fill(encoded_grad.begin(), encoded_grad.end(), T(0));
    for (std::size_t s = 0; s < n; ++s) {
        const T* e = encoded.data() + s * shape.encoded;
        T* e_grad = encoded_grad.data() + s * shape.encoded;
        const Sample<T> sample(shape, matrices, e);
        std::vector<T> hidden_grad(shape.hidden, T(0));
        for (std::size_t k = 0; k < outputs; ++k) {
            const T g = y_grad[s * outputs + k] * slope(shape, k, sample.z[k]);
            gradients.output_bias[k] += g;
            for (int h = 0; h < shape.hidden; ++h) {
                gradients.output[k * shape.hidden + h] += g * sample.hidden[h];
                hidden_grad[h] += g * matrices.output[k * shape.hidden + h];
            }
        }
        for (int h = 0; h < shape.hidden; ++h) {
            if (sample.hidden[h] <= 0) continue;
            gradients.hidden_bias[h] += hidden_grad[h];
            for (int i = 0; i < shape.encoded; ++i) {
                gradients.hidden[h * shape.encoded + i] += hidden_grad[h] * e[i];
                e_grad[i] += hidden_grad[h] * matrices.hidden[h * shape.encoded + i];
            }
        }
    }
}

template void edit_mlp_forward<float>(const EditMlpShape&, const EditMlpMatrices<const float>&, std::span<const float>,
                                      std::span<float>);
template void edit_mlp_forward<double>(const EditMlpShape&, const EditMlpMatrices<const double>&,
                                       std::span<const double>, std::span<double>);
template void edit_mlp_backward<float>(const EditMlpShape&, const EditMlpMatrices<const float>&, std::span<const float>,
                                       std::span<const float>, const EditMlpMatrices<float>&, std::span<float>);
template void edit_mlp_backward<double>(const EditMlpShape&, const EditMlpMatrices<const double>&,
                                        std::span<const double>, std::span<const double>,
                                        const EditMlpMatrices<double>&, std::span<double>);

}  // namespace fieldgraft
