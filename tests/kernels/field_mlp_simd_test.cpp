#include "core/kernels/field_mlp_simd.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/kernels/mlp_ref.h"
#include "tests/kernels/numeric.h"
#include "tests/kernels/padded_rows.h"
#include "tests/kernels/simd_targets.h"

namespace fieldgraft {
namespace {

using testing::on_every_target;
using testing::random_values;
using testing::rows_of;

std::vector<float> narrow(const std::vector<double>& values) {
    return {values.begin(), values.end()};
}

double largest_difference(const std::vector<float>& rows, int width, int n, const std::vector<double>& columns) {
    double worst = 0;
    for (int s = 0; s < n; ++s) {
        for (int i = 0; i < padded(width); ++i) {
            const double expected = i < width ? columns[std::size_t(i) * n + s] : 0;
            const double found = rows[std::size_t(s) * padded(width) + i];
            worst = std::isnan(found) ? std::numeric_limits<double>::infinity()
                                      : std::max(worst, std::abs(found - expected));
        }
    }
    return worst;
}

double largest_difference(const std::vector<float>& a, const std::vector<double>& b) {
    double worst = a.size() == b.size() ? 0 : std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < b.size(); ++i) worst = std::max(worst, std::abs(double(a[i]) - b[i]));
    return worst;
}

// The two networks with the reference kernel in double, rays' directions repeated for every sample.
struct Reference {
    FieldMlpShape shape;
    int n, rays;
    std::vector<std::vector<double>> matrices;
    std::vector<double> encoded, basis;
    std::vector<std::int32_t> ray;

    Reference(const FieldMlpShape& s, int samples) : shape(s), n(samples), rays(std::max(1, (samples + 4) / 5)) {
        // Rounded to float first, so that both sides see the same numbers.
        const auto rounded = [](std::size_t count, unsigned seed) {
            const auto values = random_values<float>(count, seed, -0.5, 0.5);
            return std::vector<double>(values.begin(), values.end());
        };
        matrices = {rounded(std::size_t(s.hidden) * s.encoded, 1), rounded(std::size_t(s.features) * s.hidden, 2),
                    rounded(std::size_t(s.color_hidden) * (s.basis + s.features), 3),
                    rounded(std::size_t(s.color_hidden) * s.color_hidden, 4),
                    rounded(std::size_t(3) * s.color_hidden, 5)};
        encoded = rounded(std::size_t(s.encoded) * n, 6);
        basis = rounded(std::size_t(s.basis) * rays, 7);
        for (int i = 0; i < n; ++i) ray.push_back((i * 7 + i / 5) % rays);  // in no order
    }
    MlpShape density_shape() const { return {{shape.encoded, shape.hidden, shape.features}}; }
    MlpShape color_shape() const { return {{shape.basis + shape.features, shape.color_hidden, shape.color_hidden, 3}}; }
    std::vector<std::span<const double>> spans(int first, int count) const {
        return {matrices.begin() + first, matrices.begin() + first + count};
    }
    FieldMlpWeights packed() const {
        std::vector<std::vector<float>> single;
        for (const auto& m : matrices) single.push_back(narrow(m));
        FieldMlpWeights weights(shape);
        weights.pack(FieldMlpMatrices(single.begin(), single.end()));
        return weights;
    }
    // (basis + features)×n
    std::vector<double> color_input(const std::vector<double>& features) const {
        std::vector<double> input;
        for (int b = 0; b < shape.basis; ++b) {
            for (int s = 0; s < n; ++s) input.push_back(basis[std::size_t(b) * rays + ray[s]]);
        }
        input.insert(input.end(), features.begin(), features.end());
        return input;
    }
};

struct Case {
    FieldMlpShape shape;
    int samples;
};

class FieldMlpSimd : public ::testing::TestWithParam<Case> {};

TEST_P(FieldMlpSimd, EqualsTheReferenceForwardAndBackward) {
    const auto& [shape, n] = GetParam();
    const Reference r(shape, n);
    const auto density_weights = r.spans(0, 2), color_weights = r.spans(2, 3);
    std::vector<std::vector<double>> density_layers, color_layers;
    mlp_forward<double>(r.density_shape(), density_weights, r.encoded, density_layers);
    const std::vector<double>& features = density_layers.back();
    const auto input = r.color_input(features);
    mlp_forward<double>(r.color_shape(), color_weights, input, color_layers);
    std::vector<double> colors = color_layers.back();
    for (double& c : colors) c = 1 / (1 + std::exp(-c));

    const auto color_grad = random_values<double>(3 * std::size_t(n), 8);
    const auto more_features_grad = random_values<double>(features.size(), 9);
    std::vector<double> logit_grad(colors.size());
    for (std::size_t i = 0; i < colors.size(); ++i) logit_grad[i] = color_grad[i] * colors[i] * (1 - colors[i]);
    std::vector<std::vector<double>> grads;
    for (const auto& m : r.matrices) grads.emplace_back(m.size(), 0.0);
    std::vector<double> input_grad(input.size()), encoded_grad(r.encoded.size());
    mlp_backward<double>(r.color_shape(), color_weights, input, color_layers, logit_grad,
                         {grads[2], grads[3], grads[4]}, input_grad);
    std::vector<double> features_grad(input_grad.begin() + std::ptrdiff_t(shape.basis) * n, input_grad.end());
    const std::vector<double> from_color = features_grad;
    for (std::size_t i = 0; i < features_grad.size(); ++i) features_grad[i] += more_features_grad[i];
    mlp_backward<double>(r.density_shape(), density_weights, r.encoded, density_layers, features_grad,
                         {grads[0], grads[1]}, encoded_grad);

    // Weights are at most 1/2 and inputs about as large: errors grow with the number of products a sum has.
    const double bound = 1e-6 * (16 + shape.hidden + shape.color_hidden);
    const FieldMlpWeights weights = r.packed();
    const int c_width = padded(shape.color_hidden), f_width = padded(shape.features);
    on_every_target([&] {
        const auto encoded_rows = rows_of(r.encoded, shape.encoded, n),
                   basis_rows = rows_of(r.basis, shape.basis, r.rays);
        std::vector<float> found_features(std::size_t(n) * f_width, NAN), base(std::size_t(r.rays) * c_width, NAN),
            hidden0(std::size_t(n) * c_width, NAN), hidden1 = hidden0, color(3 * std::size_t(n), NAN);
        density_mlp_forward(weights, encoded_rows.data(), n, found_features.data());
        EXPECT_LT(largest_difference(found_features, shape.features, n, features), bound);
        ray_color_base(weights, basis_rows.data(), r.rays, base.data());
        color_mlp_forward(weights, found_features.data(), r.ray.data(), base.data(), n, hidden0.data(), hidden1.data(),
                          color.data());
        std::vector<double> color_rows(colors.size());
        std::vector<float> color_grad_rows(colors.size());
        for (int s = 0; s < n; ++s) {
            for (int c = 0; c < 3; ++c) {
                color_rows[3 * s + c] = colors[std::size_t(c) * n + s];
                color_grad_rows[3 * s + c] = float(color_grad[std::size_t(c) * n + s]);
            }
        }
        EXPECT_LT(largest_difference(color, color_rows), bound);

        FieldMlpGradients sums(shape);
        std::vector<float> base_grad(base.size(), 0.0f), found_features_grad(found_features.size(), NAN),
            found_encoded_grad(encoded_rows.size(), NAN);
        color_mlp_backward(weights, found_features.data(), r.ray.data(), hidden0.data(), hidden1.data(), color.data(),
                           color_grad_rows.data(), n, sums, base_grad.data(), found_features_grad.data());
        ray_color_base_backward(weights, basis_rows.data(), base_grad.data(), r.rays, sums);
        EXPECT_LT(largest_difference(found_features_grad, shape.features, n, from_color), bound);
        const auto more = rows_of(more_features_grad, shape.features, n);
        for (std::size_t i = 0; i < more.size(); ++i) found_features_grad[i] += more[i];
        density_mlp_backward(weights, encoded_rows.data(), found_features_grad.data(), n, sums,
                             found_encoded_grad.data());
        EXPECT_LT(largest_difference(found_encoded_grad, shape.encoded, n, encoded_grad), bound);

        std::vector<std::vector<float>> found;
        for (const auto& m : r.matrices) found.emplace_back(m.size(), 0.0f);
        sums.add_to(shape, std::vector<std::span<float>>(found.begin(), found.end()));
        for (std::size_t i = 0; i < found.size(); ++i) {
            EXPECT_LT(largest_difference(found[i], grads[i]), bound * (8 + n)) << "matrix " << i;
        }
    });
}

INSTANTIATE_TEST_SUITE_P(ShapesAndCounts, FieldMlpSimd,
                         ::testing::Values(Case{{32, 64, 16, 16, 64}, 0}, Case{{32, 64, 16, 16, 64}, 1},
                                           Case{{32, 64, 16, 16, 64}, 5}, Case{{32, 64, 16, 16, 64}, 48},
                                           Case{{32, 64, 16, 16, 64}, 131}, Case{{16, 32, 16, 9, 32}, 77},
                                           Case{{24, 48, 7, 4, 20}, 53}, Case{{3, 5, 1, 1, 130}, 49},
                                           Case{{128, 256, 33, 16, 256}, 97}));

TEST(FieldMlpSimdHardInputs, ColorsStayInBoundsAndNaNIsNotHidden) {
    const FieldMlpShape shape{1, 1, 1, 1, 1};
    FieldMlpWeights weights(shape);
    const std::vector<float> one{1}, both{0, 1}, three{1, 1e4f, -1e4f};
    weights.pack({one, one, both, one, three});
    const auto color_of = [&](float feature) {
        std::vector<float> features(16, 0.0f), base(16, 0.0f), hidden0(16), hidden1(16), color(3);
        features[0] = feature;
        const std::int32_t ray = 0;
        color_mlp_forward(weights, features.data(), &ray, base.data(), 1, hidden0.data(), hidden1.data(), color.data());
        return color;
    };
    EXPECT_EQ(color_of(1e6f)[1], 1);
    EXPECT_NEAR(color_of(1e6f)[2], 0, 1e-37);
    EXPECT_TRUE(std::isnan(color_of(NAN)[0]));
    EXPECT_NEAR(color_of(0.5f)[0], 1 / (1 + std::exp(-0.5)), 1e-6);
    EXPECT_EQ(color_of(0)[0], 0.5f);
}

TEST(FieldMlpSimdHardInputs, RefusesWrongSizes) {
    EXPECT_THROW(FieldMlpWeights({0, 64, 16, 16, 64}), std::invalid_argument);
    EXPECT_THROW(FieldMlpWeights({32, 4097, 16, 16, 64}), std::invalid_argument);
    FieldMlpWeights weights({2, 2, 2, 2, 2});
    const std::vector<float> four(4), six(6), eight(8);
    EXPECT_NO_THROW(weights.pack({four, four, eight, four, six}));
    EXPECT_THROW(weights.pack({four, four, four, four, six}), std::invalid_argument);
    EXPECT_THROW(weights.pack({four, four}), std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
