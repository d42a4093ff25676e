// The editable field's network over rows of samples: the plain-loop reference of edit_mlp_simd.h.
//
//   h = relu(W e + b)   z = V h + c   y_k = scale · softplus(z_k)  or  sigmoid(8 tanh(z_k / 8))
//
// Layout: rows of samples, e n×E, y n×K; W H×E, b H, V K×H, c K, row-major. softplus is max(z, 0) + log1p(e^−|z|). The
// gradient of ReLU at 0 is 0. Errors: sums as in mlp_ref.h; the last step within a few ε of y.
#pragma once

#include <span>
#include <vector>

namespace fieldgraft {

enum class EditActivation { softplus, bounded };

struct EditMlpShape {
    int encoded = 12, hidden = 64;
    std::vector<EditActivation> outputs;  // 1 to 16
    float density_scale = 1;              // of softplus
    // Throws std::invalid_argument: widths outside 1 … 4096, no output or more than 16.
    void check() const;
};

constexpr double bounded_logit = 8;  // sigmoid stays within 3.4e-4 of 0 and 1, its gradient alive

template <class T>
struct EditMlpMatrices {
    std::span<T> hidden, hidden_bias, output, output_bias;
};

template <class T>
void edit_mlp_forward(const EditMlpShape& shape, const EditMlpMatrices<const T>& matrices, std::span<const T> encoded,
                      std::span<T> y);

// Adds to `gradients`; writes encoded_grad.
template <class T>
void edit_mlp_backward(const EditMlpShape& shape, const EditMlpMatrices<const T>& matrices, std::span<const T> encoded,
                       std::span<const T> y_grad, const EditMlpMatrices<T>& gradients, std::span<T> encoded_grad);

}  // namespace fieldgraft
