// The hash-grid field's two networks over rows of samples, without biases: SIMD, dispatched at run time.
//
//   h = relu(W₀ e)   f = W₁ h                                                     (density network: log density is f₀)
//   p = relu(V₀ [Y; f])   q = relu(V₁ p)   c = sigmoid(V₂ q)                       (colour network)
//
// Layout: every activation is row-major, one row a sample, rows padded with zeros to a multiple of 16 floats
// (`padded`). What the direction Y adds to p is the same for all samples of a ray: it is computed once a ray
// (`ray_color_base`), and samples say which ray is theirs. One thread; callers split samples, and add up the gradients
// of their parts.
//
// With Precision::bfloat16 the layers' products are field_mlp_amx.h's, on machines that have its instructions and for
// layers of at most 128; elsewhere they stay float32.
//
// Errors against exact arithmetic: a sum of m products within (m + 2) ε Σ|w h|; sigmoid within 4 ε. The gradient of
// ReLU at 0 is 0. A NaN reaches every output that depends on it. Reference: mlp_ref.h.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/kernels/field_mlp_amx.h"

namespace fieldgraft {

enum class Precision { float32, bfloat16 };

constexpr int padded(int width) {
    return (width + 15) / 16 * 16;
}

struct FieldMlpShape {
    int encoded = 32, hidden = 64, features = 16, basis = 16, color_hidden = 64;
    // Throws std::invalid_argument: widths outside 1 … 4096.
    void check() const;
    // Rows (out) and columns (in) of the five matrices, as the field stores them.
    std::array<std::array<std::int64_t, 2>, 5> matrices() const;
};

// W₀, W₁, V₀ (its columns: Y, then f), V₁, V₂: row-major out×in.
using FieldMlpMatrices = std::vector<std::span<const float>>;

// The same numbers as the kernels read them, padded, each matrix both ways. Repack after every step of an optimiser.
class FieldMlpWeights {
  public:
    explicit FieldMlpWeights(const FieldMlpShape& shape, Precision precision = Precision::float32);
    void pack(const FieldMlpMatrices& matrices);
    const FieldMlpShape& shape() const { return shape_; }
    // bfloat16 only where that is what is computed in.
    Precision precision() const { return precision_; }
    // bfloat16 only.
    amx::DensityNetwork density_tiles() const;
    amx::ColorNetwork color_tiles() const;

    // in×out, and (named "back") out×in.
    std::vector<float> density0, density0_back, density1, density1_back, color_basis, color0, color0_back, color1,
        color1_back, color2;

  private:
    void pack_tiles();

    FieldMlpShape shape_;
    Precision precision_;
    // density0, its back, density1, its back, color0, its back, color1, its back, color2.
    std::array<std::vector<std::uint16_t>, 9> tiles_;
};

// Sums of gradients, in×out, padded; color2 is 3×in.
struct FieldMlpGradients {
    explicit FieldMlpGradients(const FieldMlpShape& shape);
    void clear();
    void add(const FieldMlpGradients& other);
    // += into matrices laid out like FieldMlpMatrices.
    void add_to(const FieldMlpShape& shape, const std::vector<std::span<float>>& matrices) const;

    std::vector<float> density0, density1, color_basis, color0, color1, color2;
};

// encoded n×E → features n×F (E, F padded).
void density_mlp_forward(const FieldMlpWeights& weights, const float* encoded, int n, float* features);
// Adds to the gradients; writes encoded_grad n×E. The hidden layer is computed again.
void density_mlp_backward(const FieldMlpWeights& weights, const float* encoded, const float* features_grad, int n,
                          FieldMlpGradients& gradients, float* encoded_grad);

// basis R×B (B padded: spherical harmonics of R directions) → base R×C.
void ray_color_base(const FieldMlpWeights& weights, const float* basis, int rays, float* base);
// features n×F, ray n, base R×C → hidden0 and hidden1 n×C (for the backward pass), color n×3.
void color_mlp_forward(const FieldMlpWeights& weights, const float* features, const std::int32_t* ray,
                       const float* base, int n, float* hidden0, float* hidden1, float* color);
// color_grad n×3 is the gradient of color. Adds to the gradients and to base_grad R×C; writes features_grad n×F.
void color_mlp_backward(const FieldMlpWeights& weights, const float* features, const std::int32_t* ray,
                        const float* hidden0, const float* hidden1, const float* color, const float* color_grad, int n,
                        FieldMlpGradients& gradients, float* base_grad, float* features_grad);
// What base_grad means for the basis' part of V₀.
void ray_color_base_backward(const FieldMlpWeights& weights, const float* basis, const float* base_grad, int rays,
                             FieldMlpGradients& gradients);

}  // namespace fieldgraft
