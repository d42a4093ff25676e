#include "core/kernels/field_mlp_simd.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/field_mlp_simd.cpp"
#include "core/kernels/simd_targets.h"
// Must come after the choice of targets.
#include <hwy/contrib/math/math-inl.h>
#include "core/kernels/gemm-inl.h"

HWY_BEFORE_NAMESPACE();
namespace fieldgraft {
namespace HWY_NAMESPACE {

struct Widths {
    int e, h, f, b, c;
    explicit Widths(const FieldMlpShape& s)
        : e(padded(s.encoded)),
          h(padded(s.hidden)),
          f(padded(s.features)),
          b(padded(s.basis)),
          c(padded(s.color_hidden)) {}
};

void density_forward(const FieldMlpWeights& weights, const float* encoded, int n, float* features) {
    const Widths w(weights.shape());
    std::vector<float> scratch(std::size_t(tile) * w.h);
    float* hidden = scratch.data();
    for_tiles(n, [&](std::size_t first, int count) HWY_ATTR {
        rows_times<Store::relu>(encoded + first * w.e, w.e, weights.density0.data(), hidden, count, w.h, w.e);
        rows_times<Store::write>(hidden, w.h, weights.density1.data(), features + first * w.f, count, w.f, w.h);
    });
}

void density_backward(const FieldMlpWeights& weights, const float* encoded, const float* features_grad, int n,
                      FieldMlpGradients& gradients, float* encoded_grad) {
    const Widths w(weights.shape());
    std::vector<float> scratch(std::size_t(2) * tile * w.h);
    float *hidden = scratch.data(), *hidden_grad = hidden + tile * w.h;
    for_tiles(n, [&](std::size_t first, int count) HWY_ATTR {
        const float* e = encoded + first * w.e;
        const float* fg = features_grad + first * w.f;
        rows_times<Store::relu>(e, w.e, weights.density0.data(), hidden, count, w.h, w.e);
        rows_times<Store::gated>(fg, w.f, weights.density1_back.data(), hidden_grad, count, w.h, w.f, hidden);
        add_outer(hidden, w.h, w.h, fg, w.f, count, gradients.density1.data());
        add_outer(e, w.e, w.e, hidden_grad, w.h, count, gradients.density0.data());
        rows_times<Store::write>(hidden_grad, w.h, weights.density0_back.data(), encoded_grad + first * w.e, count, w.e,
                                 w.h);
    });
}

void color_base(const FieldMlpWeights& weights, const float* basis, int rays, float* base) {
    const Widths w(weights.shape());
    rows_times<Store::write>(basis, w.b, weights.color_basis.data(), base, rays, w.c, w.b);
}

void color_base_backward(const FieldMlpWeights& weights, const float* basis, const float* base_grad, int rays,
                         FieldMlpGradients& gradients) {
    const Widths w(weights.shape());
    add_outer(basis, w.b, w.b, base_grad, w.c, rays, gradients.color_basis.data());
}

// logits (count×3) of the last layer: three sums over a row.
HWY_INLINE void last_layer(const float* matrix, int width, const float* rows, int count, float* logits) {
    const Lanes d;
    for (int s = 0; s < count; ++s) {
        Vector sum[3] = {hn::Zero(d), hn::Zero(d), hn::Zero(d)};
        for (int i = 0; i < width; i += lanes) {
            const Vector x = hn::LoadU(d, rows + std::size_t(s) * width + i);
            for (int c = 0; c < 3; ++c) sum[c] = hn::MulAdd(x, hn::LoadU(d, matrix + c * width + i), sum[c]);
        }
        for (int c = 0; c < 3; ++c) logits[3 * s + c] = hn::GetLane(hn::SumOfLanes(d, sum[c]));
    }
}

// x → 1/(1 + e^−x) in place; `count` values in a buffer padded to whole vectors.
HWY_INLINE void sigmoid(float* x, int count) {
    const Lanes d;
    const Vector one = hn::Set(d, 1.0f), most = hn::Set(d, 88.0f);
    for (int i = 0; i < count; i += lanes) {
        const Vector value = hn::LoadU(d, x + i);
        const Vector negative = hn::IfThenElse(hn::Lt(hn::Neg(value), most), hn::Neg(value), most);
        const Vector result = hn::Div(one, hn::Add(one, hn::Exp(d, negative)));
        hn::StoreU(hn::IfThenElse(hn::Eq(value, value), result, value), d, x + i);
    }
}

// The same for a buffer of any length.
void sigmoid_all(float* x, std::size_t count) {
    const std::size_t whole = count / lanes * lanes;
    sigmoid(x, static_cast<int>(whole));
    HWY_ALIGN float rest[lanes] = {};
    std::copy(x + whole, x + count, rest);
    sigmoid(rest, static_cast<int>(lanes));
    std::copy_n(rest, count - whole, x + whole);
}

void color_forward(const FieldMlpWeights& weights, const float* features, const std::int32_t* ray, const float* base,
                   int n, float* hidden0, float* hidden1, float* color) {
    const Widths w(weights.shape());
    const Lanes d;
    HWY_ALIGN float out[3 * tile + 16];
    for_tiles(n, [&](std::size_t first, int count) HWY_ATTR {
        float* p = hidden0 + first * w.c;
        float* q = hidden1 + first * w.c;
        for (int s = 0; s < count; ++s) {
            const float* from = base + std::size_t(ray[first + s]) * w.c;
            for (int i = 0; i < w.c; i += lanes) hn::StoreU(hn::LoadU(d, from + i), d, p + std::size_t(s) * w.c + i);
        }
        rows_times<Store::add>(features + first * w.f, w.f, weights.color0.data(), p, count, w.c, w.f);
        for (int i = 0; i < count * w.c; i += lanes) {
            hn::StoreU(relu(hn::LoadU(d, p + i)), d, p + i);
        }
        rows_times<Store::relu>(p, w.c, weights.color1.data(), q, count, w.c, w.c);
        last_layer(weights.color2.data(), w.c, q, count, out);
        std::fill_n(out + 3 * count, 16, 0.0f);
        sigmoid(out, 3 * count);
        std::copy_n(out, 3 * count, color + 3 * first);
    });
}

void color_backward(const FieldMlpWeights& weights, const float* features, const std::int32_t* ray,
                    const float* hidden0, const float* hidden1, const float* color, const float* color_grad, int n,
                    FieldMlpGradients& gradients, float* base_grad, float* features_grad) {
    const Widths w(weights.shape());
    const Lanes d;
    HWY_ALIGN float logit_grad[4 * tile];
    std::vector<float> scratch(std::size_t(2) * tile * w.c);
    float *grad1 = scratch.data(), *grad0 = grad1 + tile * w.c;
    for_tiles(n, [&](std::size_t first, int count) HWY_ATTR {
        const float* p = hidden0 + first * w.c;
        const float* q = hidden1 + first * w.c;
        for (int i = 0; i < 3 * count; ++i) {
            const float c = color[3 * first + i];
            logit_grad[i / 3 * 4 + i % 3] = color_grad[3 * first + i] * c * (1 - c);
        }
        // 3×C: the sums run over samples as they do for the other matrices.
        multiply<Store::add>(
            {logit_grad, 1, 4, q, std::size_t(w.c), gradients.color2.data(), std::size_t(w.c), nullptr}, 3, w.c, count);
        rows_times<Store::gated>(logit_grad, 4, weights.color2.data(), grad1, count, w.c, 3, q);
        add_outer(p, w.c, w.c, grad1, w.c, count, gradients.color1.data());
        rows_times<Store::gated>(grad1, w.c, weights.color1_back.data(), grad0, count, w.c, w.c, p);
        add_outer(features + first * w.f, w.f, w.f, grad0, w.c, count, gradients.color0.data());
        for (int s = 0; s < count; ++s) {
            float* to = base_grad + std::size_t(ray[first + s]) * w.c;
            for (int i = 0; i < w.c; i += lanes) {
                const Vector more = hn::LoadU(d, grad0 + std::size_t(s) * w.c + i);
                hn::StoreU(hn::Add(hn::LoadU(d, to + i), more), d, to + i);
            }
        }
        rows_times<Store::write>(grad0, w.c, weights.color0_back.data(), features_grad + first * w.f, count, w.f, w.c);
    });
}

}  // namespace HWY_NAMESPACE
}  // namespace fieldgraft
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fieldgraft {
namespace {

// out×in, columns [first, first + in) of rows of length `row`, as in×out with both padded.
void copy_transposed(std::span<const float> matrix, int row, int first, int in, int out, std::vector<float>& to) {
    const int stride = padded(out);
    for (int o = 0; o < out; ++o) {
        for (int i = 0; i < in; ++i) to[std::size_t(i) * stride + o] = matrix[std::size_t(o) * row + first + i];
    }
}

void copy_plain(std::span<const float> matrix, int row, int first, int in, int out, std::vector<float>& to) {
    for (int o = 0; o < out; ++o) {
        for (int i = 0; i < in; ++i) to[std::size_t(o) * padded(in) + i] = matrix[std::size_t(o) * row + first + i];
    }
}

void add_transposed(const std::vector<float>& from, int row, int first, int in, int out, std::span<float> matrix) {
    for (int o = 0; o < out; ++o) {
        for (int i = 0; i < in; ++i) {
            matrix[std::size_t(o) * row + first + i] += from[std::size_t(i) * padded(out) + o];
        }
    }
}

void add_vector(std::vector<float>& to, const std::vector<float>& from) {
    for (std::size_t i = 0; i < to.size(); ++i) to[i] += from[i];
}

std::size_t area(int a, int b) {
    return std::size_t(padded(a)) * padded(b);
}

}  // namespace

void FieldMlpShape::check() const {
    for (const int width : {encoded, hidden, features, basis, color_hidden}) {
        if (width < 1 || width > 4096) {
            throw std::invalid_argument("field mlp: widths must be 1 to 4096, not " + std::to_string(width));
        }
    }
}

std::array<std::array<std::int64_t, 2>, 5> FieldMlpShape::matrices() const {
    return {{{hidden, encoded},
             {features, hidden},
             {color_hidden, basis + features},
             {color_hidden, color_hidden},
             {3, color_hidden}}};
}

FieldMlpWeights::FieldMlpWeights(const FieldMlpShape& shape, Precision precision)
    : shape_(shape), precision_(precision) {
    shape.check();
    const int largest = std::max({shape.encoded, shape.hidden, shape.features, shape.color_hidden});
    if (padded(largest) > amx::widest || (precision == Precision::bfloat16 && !amx::available())) {
        precision_ = Precision::float32;
    }
    const auto& s = shape;
    density0.resize(area(s.encoded, s.hidden));
    density0_back.resize(area(s.encoded, s.hidden));
    density1.resize(area(s.hidden, s.features));
    density1_back.resize(area(s.hidden, s.features));
    color_basis.resize(area(s.basis, s.color_hidden));
    color0.resize(area(s.features, s.color_hidden));
    color0_back.resize(area(s.features, s.color_hidden));
    color1.resize(area(s.color_hidden, s.color_hidden));
    color1_back.resize(area(s.color_hidden, s.color_hidden));
    color2.resize(3 * padded(s.color_hidden));
}

void FieldMlpWeights::pack(const FieldMlpMatrices& m) {
    const auto& s = shape_;
    const auto shapes = s.matrices();
    for (std::size_t i = 0; i < shapes.size(); ++i) {
        if (m.size() != shapes.size() || m[i].size() != static_cast<std::size_t>(shapes[i][0] * shapes[i][1])) {
            throw std::invalid_argument("field mlp: matrix " + std::to_string(i) + " does not have its shape's size");
        }
    }
    const int color_row = s.basis + s.features;
    copy_transposed(m[0], s.encoded, 0, s.encoded, s.hidden, density0);
    copy_plain(m[0], s.encoded, 0, s.encoded, s.hidden, density0_back);
    copy_transposed(m[1], s.hidden, 0, s.hidden, s.features, density1);
    copy_plain(m[1], s.hidden, 0, s.hidden, s.features, density1_back);
    copy_transposed(m[2], color_row, 0, s.basis, s.color_hidden, color_basis);
    copy_transposed(m[2], color_row, s.basis, s.features, s.color_hidden, color0);
    copy_plain(m[2], color_row, s.basis, s.features, s.color_hidden, color0_back);
    copy_transposed(m[3], s.color_hidden, 0, s.color_hidden, s.color_hidden, color1);
    copy_plain(m[3], s.color_hidden, 0, s.color_hidden, s.color_hidden, color1_back);
    copy_plain(m[4], s.color_hidden, 0, s.color_hidden, 3, color2);
    if (precision_ == Precision::bfloat16) pack_tiles();
}

void FieldMlpWeights::pack_tiles() {
    const int e = padded(shape_.encoded), h = padded(shape_.hidden), f = padded(shape_.features),
              c = padded(shape_.color_hidden);
    std::vector<float> last(std::size_t(c) * 16);  // color2 as in×out
    for (int i = 0; i < c; ++i) {
        for (int o = 0; o < 3; ++o) last[std::size_t(i) * 16 + o] = color2[std::size_t(o) * c + i];
    }
    const struct {
        const std::vector<float>& matrix;
        int in, out;
    } all[] = {{density0, e, h},    {density0_back, h, e}, {density1, h, f},    {density1_back, f, h}, {color0, f, c},
               {color0_back, c, f}, {color1, c, c},        {color1_back, c, c}, {last, c, 16}};
    for (std::size_t i = 0; i < tiles_.size(); ++i) {
        tiles_[i].resize(amx::tiles_size(all[i].in, all[i].out));
        amx::pack_tiles(all[i].matrix.data(), all[i].in, all[i].out, tiles_[i].data());
    }
}

amx::DensityNetwork FieldMlpWeights::density_tiles() const {
    return {padded(shape_.encoded), padded(shape_.hidden), padded(shape_.features), tiles_[0].data(),
            tiles_[2].data(),       tiles_[1].data(),      tiles_[3].data()};
}

amx::ColorNetwork FieldMlpWeights::color_tiles() const {
    return {padded(shape_.features), padded(shape_.color_hidden),
            tiles_[4].data(),        tiles_[6].data(),
            tiles_[8].data(),        tiles_[5].data(),
            tiles_[7].data(),        color2.data()};
}

FieldMlpGradients::FieldMlpGradients(const FieldMlpShape& s)
    : density0(area(s.encoded, s.hidden)),
      density1(area(s.hidden, s.features)),
      color_basis(area(s.basis, s.color_hidden)),
      color0(area(s.features, s.color_hidden)),
      color1(area(s.color_hidden, s.color_hidden)),
      color2(3 * padded(s.color_hidden)) {}

void FieldMlpGradients::clear() {
    for (auto* part : {&density0, &density1, &color_basis, &color0, &color1, &color2}) {
        std::fill(part->begin(), part->end(), 0.0f);
    }
}

void FieldMlpGradients::add(const FieldMlpGradients& other) {
    add_vector(density0, other.density0);
    add_vector(density1, other.density1);
    add_vector(color_basis, other.color_basis);
    add_vector(color0, other.color0);
    add_vector(color1, other.color1);
    add_vector(color2, other.color2);
}

void FieldMlpGradients::add_to(const FieldMlpShape& s, const std::vector<std::span<float>>& m) const {
    if (m.size() != 5) throw std::invalid_argument("field mlp: five gradients are needed");
    const int color_row = s.basis + s.features;
    add_transposed(density0, s.encoded, 0, s.encoded, s.hidden, m[0]);
    add_transposed(density1, s.hidden, 0, s.hidden, s.features, m[1]);
    add_transposed(color_basis, color_row, 0, s.basis, s.color_hidden, m[2]);
    add_transposed(color0, color_row, s.basis, s.features, s.color_hidden, m[2]);
    add_transposed(color1, s.color_hidden, 0, s.color_hidden, s.color_hidden, m[3]);
    for (int o = 0; o < 3; ++o) {
        for (int i = 0; i < s.color_hidden; ++i) {
            m[4][std::size_t(o) * s.color_hidden + i] += color2[std::size_t(o) * padded(s.color_hidden) + i];
        }
    }
}

HWY_EXPORT(density_forward);
HWY_EXPORT(density_backward);
HWY_EXPORT(color_base);
HWY_EXPORT(color_base_backward);
HWY_EXPORT(color_forward);
HWY_EXPORT(color_backward);
HWY_EXPORT(sigmoid_all);

void density_mlp_forward(const FieldMlpWeights& weights, const float* encoded, int n, float* features) {
    if (weights.precision() == Precision::bfloat16) {
        return amx::density_forward(weights.density_tiles(), encoded, n, features);
    }
    HWY_DYNAMIC_DISPATCH(density_forward)(weights, encoded, n, features);
}

void density_mlp_backward(const FieldMlpWeights& weights, const float* encoded, const float* features_grad, int n,
                          FieldMlpGradients& gradients, float* encoded_grad) {
    if (weights.precision() == Precision::bfloat16) {
        return amx::density_backward(weights.density_tiles(), encoded, features_grad, n, gradients.density0.data(),
                                     gradients.density1.data(), encoded_grad);
    }
    HWY_DYNAMIC_DISPATCH(density_backward)(weights, encoded, features_grad, n, gradients, encoded_grad);
}

void ray_color_base(const FieldMlpWeights& weights, const float* basis, int rays, float* base) {
    HWY_DYNAMIC_DISPATCH(color_base)(weights, basis, rays, base);
}

void ray_color_base_backward(const FieldMlpWeights& weights, const float* basis, const float* base_grad, int rays,
                             FieldMlpGradients& gradients) {
    HWY_DYNAMIC_DISPATCH(color_base_backward)(weights, basis, base_grad, rays, gradients);
}

void color_mlp_forward(const FieldMlpWeights& weights, const float* features, const std::int32_t* ray,
                       const float* base, int n, float* hidden0, float* hidden1, float* color) {
    if (weights.precision() == Precision::bfloat16) {
        amx::color_forward(weights.color_tiles(), features, ray, base, n, hidden0, hidden1, color);
        return HWY_DYNAMIC_DISPATCH(sigmoid_all)(color, 3 * std::size_t(n));
    }
    HWY_DYNAMIC_DISPATCH(color_forward)(weights, features, ray, base, n, hidden0, hidden1, color);
}

void color_mlp_backward(const FieldMlpWeights& weights, const float* features, const std::int32_t* ray,
                        const float* hidden0, const float* hidden1, const float* color, const float* color_grad, int n,
                        FieldMlpGradients& gradients, float* base_grad, float* features_grad) {
    if (weights.precision() == Precision::bfloat16) {
        std::vector<float> logit_grad(3 * std::size_t(n));
        for (std::size_t i = 0; i < logit_grad.size(); ++i) logit_grad[i] = color_grad[i] * color[i] * (1 - color[i]);
        return amx::color_backward(weights.color_tiles(), features, ray, hidden0, hidden1, logit_grad.data(), n,
                                   gradients.color0.data(), gradients.color1.data(), gradients.color2.data(), base_grad,
                                   features_grad);
    }
    HWY_DYNAMIC_DISPATCH(color_backward)
    (weights, features, ray, hidden0, hidden1, color, color_grad, n, gradients, base_grad, features_grad);
}

}  // namespace fieldgraft
#endif  // HWY_ONCE
