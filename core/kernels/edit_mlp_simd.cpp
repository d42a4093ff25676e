#include "core/kernels/edit_mlp_simd.h"

#include <algorithm>
#include <stdexcept>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/edit_mlp_simd.cpp"
#include "core/kernels/simd_targets.h"
// Must come after the choice of targets.
#include <hwy/contrib/math/math-inl.h>
#include "core/kernels/gemm-inl.h"

HWY_BEFORE_NAMESPACE();
namespace fieldgraft {
namespace HWY_NAMESPACE {

constexpr int outputs_row = 16;

// z of a tile, one column an output, its values and their slopes.
struct TileOutputs {
    HWY_ALIGN float z[outputs_row][tile], y[outputs_row][tile], slope[outputs_row][tile];
};

HWY_INLINE Vector kept_nan(Vector z, Vector value) {
    return hn::IfThenElse(hn::Eq(z, z), value, z);
}

HWY_INLINE void softplus(const float* z, int count, float scale, float* y, float* slope) {
    const Lanes d;
    const Vector one = hn::Set(d, 1.0f), factor = hn::Set(d, scale), zero = hn::Zero(d);
    for (int i = 0; i < count; i += lanes) {
        const Vector x = hn::Load(d, z + i), e = hn::Exp(d, hn::Neg(hn::Abs(x)));
        const Vector value = hn::Add(hn::IfThenElse(hn::Gt(x, zero), x, zero), hn::Log1p(d, e));
        const Vector chance = hn::Div(hn::IfThenElse(hn::Gt(x, zero), one, e), hn::Add(one, e));
        hn::Store(kept_nan(x, hn::Mul(factor, value)), d, y + i);
        hn::Store(kept_nan(x, hn::Mul(factor, chance)), d, slope + i);
    }
}

HWY_INLINE void bounded(const float* z, int count, float* y, float* slope) {
    const Lanes d;
    const Vector one = hn::Set(d, 1.0f), bound = hn::Set(d, float(bounded_logit));
    const Vector half_bound = hn::Set(d, float(bounded_logit / 2));
    for (int i = 0; i < count; i += lanes) {
        const Vector x = hn::Load(d, z + i), t = hn::Tanh(d, hn::Div(x, bound));
        const Vector e = hn::Exp(d, hn::Neg(hn::Mul(bound, t)));  // within e^±8
        const Vector value = hn::Div(one, hn::Add(one, e));
        // 1 − y is e y and 1 − t² is 4q/(1 + q)², q = e^−2|x/8|: no cancellation where y or t is near 1.
        const Vector q = hn::Exp(d, hn::Neg(hn::Abs(hn::Div(x, half_bound)))), sum = hn::Add(one, q);
        const Vector bend = hn::Div(hn::Mul(hn::Set(d, 4.0f), q), hn::Mul(sum, sum));
        const Vector chance = hn::Mul(hn::Mul(value, hn::Mul(value, e)), bend);
        hn::Store(kept_nan(x, value), d, y + i);
        hn::Store(kept_nan(x, chance), d, slope + i);
    }
}

// hidden count×H; z, y and slopes of the tile. `rows` is scratch, tile × outputs_row.
HWY_INLINE void tile_forward(const EditMlpWeights& weights, const float* encoded, int count, float* hidden, float* rows,
                             TileOutputs& out) {
    const int h = weights.hidden(), outputs = static_cast<int>(weights.shape().outputs.size());
    rows_times<Store::relu>(encoded, weights.row(), weights.first.data(), hidden, count, h, weights.row());
    for (int s = 0; s < count; ++s) std::copy_n(weights.last_bias.data(), outputs_row, rows + s * outputs_row);
    rows_times<Store::add>(hidden, h, weights.last.data(), rows, count, outputs_row, h);
    for (int k = 0; k < outputs; ++k) {
        for (int s = 0; s < count; ++s) out.z[k][s] = rows[s * outputs_row + k];
        for (int s = count; s < tile; ++s) out.z[k][s] = 0;
        if (weights.shape().outputs[k] == EditActivation::softplus) {
            softplus(out.z[k], count, weights.shape().density_scale, out.y[k], out.slope[k]);
        } else {
            bounded(out.z[k], count, out.y[k], out.slope[k]);
        }
    }
}

void forward(const EditMlpWeights& weights, const float* encoded, int n, const EditColumns<float>& outputs) {
    std::vector<float> scratch(std::size_t(tile) * (weights.hidden() + outputs_row));
    float* hidden = scratch.data();
    TileOutputs out;
    for_tiles(n, [&](std::size_t first, int count) HWY_ATTR {
        tile_forward(weights, encoded + first * weights.row(), count, hidden, hidden + tile * weights.hidden(), out);
        for (std::size_t k = 0; k < weights.shape().outputs.size(); ++k) {
            if (outputs.data[k] == nullptr) continue;
            for (int s = 0; s < count; ++s)
                outputs.data[k][std::size_t(outputs.index[first + s]) * outputs.step[k]] = out.y[k][s];
        }
    });
}

void backward(const EditMlpWeights& weights, const float* encoded, int n, const EditColumns<const float>& grads,
              EditMlpGradients& gradients, float* encoded_grad) {
    const int h = weights.hidden(), row = weights.row(), outputs = static_cast<int>(weights.shape().outputs.size());
    std::vector<float> scratch(std::size_t(tile) * (2 * h + outputs_row));
    float *hidden = scratch.data(), *hidden_grad = hidden + tile * h, *rows = hidden_grad + tile * h;
    TileOutputs out;
    for_tiles(n, [&](std::size_t first, int count) HWY_ATTR {
        const float* e = encoded + first * row;
        tile_forward(weights, e, count, hidden, rows, out);
        std::fill_n(rows, count * outputs_row, 0.0f);  // now the gradient of z
        for (int k = 0; k < outputs; ++k) {
            if (grads.data[k] == nullptr) continue;
            float sum = 0;
            for (int s = 0; s < count; ++s) {
                const float g = grads.data[k][std::size_t(grads.index[first + s]) * grads.step[k]] * out.slope[k][s];
                rows[s * outputs_row + k] = g;
                sum += g;
            }
            gradients.last_bias[k] += sum;
        }
        add_outer(hidden, h, h, rows, outputs_row, count, gradients.last.data());
        rows_times<Store::gated>(rows, outputs_row, weights.last_back.data(), hidden_grad, count, h, outputs, hidden);
        add_outer(e, row, row, hidden_grad, h, count, gradients.first.data());
        rows_times<Store::write>(hidden_grad, h, weights.first_back.data(), encoded_grad + first * row, count, row, h);
    });
}

}  // namespace HWY_NAMESPACE
}  // namespace fieldgraft
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fieldgraft {
namespace {

constexpr int padded_to_16(int width) {
    return (width + 15) / 16 * 16;
}

void add_vector(std::vector<float>& to, const std::vector<float>& from) {
    for (std::size_t i = 0; i < to.size(); ++i) to[i] += from[i];
}

}  // namespace

EditMlpWeights::EditMlpWeights(const EditMlpShape& shape, const EditMlpMatrices<const float>& m)
    : shape_(shape), row_(padded_to_16(shape.encoded + 1)), hidden_(padded_to_16(shape.hidden)) {
    shape.check();
    const std::size_t e = shape.encoded, h = shape.hidden, k = shape.outputs.size();
    if (m.hidden.size() != h * e || m.hidden_bias.size() != h || m.output.size() != k * h || m.output_bias.size() != k)
        throw std::invalid_argument("edit mlp: a matrix does not have its shape's size");
    first.resize(std::size_t(row_) * hidden_);
    first_back.resize(first.size());
    last.resize(std::size_t(hidden_) * 16);
    last_back.resize(k * hidden_);
    last_bias.resize(16);
    for (std::size_t o = 0; o < h; ++o) {
        for (std::size_t i = 0; i < e; ++i) first[i * hidden_ + o] = first_back[o * row_ + i] = m.hidden[o * e + i];
        first[e * hidden_ + o] = m.hidden_bias[o];
    }
    for (std::size_t o = 0; o < k; ++o) {
        for (std::size_t i = 0; i < h; ++i) last[i * 16 + o] = last_back[o * hidden_ + i] = m.output[o * h + i];
        last_bias[o] = m.output_bias[o];
    }
}

EditMlpGradients::EditMlpGradients(const EditMlpWeights& weights)
    : row(weights.row()),
      hidden(weights.hidden()),
      first(weights.first.size()),
      last(weights.last.size()),
      last_bias(weights.last_bias.size()) {}

void EditMlpGradients::add(const EditMlpGradients& other) {
    add_vector(first, other.first);
    add_vector(last, other.last);
    add_vector(last_bias, other.last_bias);
}

void EditMlpGradients::add_to(const EditMlpShape& shape, const EditMlpMatrices<float>& m) const {
    const std::size_t e = shape.encoded, h = shape.hidden, k = shape.outputs.size();
    for (std::size_t o = 0; o < h; ++o) {
        for (std::size_t i = 0; i < e; ++i) m.hidden[o * e + i] += first[i * hidden + o];
        m.hidden_bias[o] += first[e * hidden + o];
    }
    for (std::size_t o = 0; o < k; ++o) {
        for (std::size_t i = 0; i < h; ++i) m.output[o * h + i] += last[i * 16 + o];
        m.output_bias[o] += last_bias[o];
    }
}

HWY_EXPORT(forward);
HWY_EXPORT(backward);

void edit_mlp_forward(const EditMlpWeights& weights, const float* encoded, int n, const EditColumns<float>& outputs) {
    HWY_DYNAMIC_DISPATCH(forward)(weights, encoded, n, outputs);
}

void edit_mlp_backward(const EditMlpWeights& weights, const float* encoded, int n,
                       const EditColumns<const float>& output_grads, EditMlpGradients& gradients, float* encoded_grad) {
    HWY_DYNAMIC_DISPATCH(backward)(weights, encoded, n, output_grads, gradients, encoded_grad);
}

}  // namespace fieldgraft
#endif  // HWY_ONCE
