// Inputs are chosen so that what is rounded to bfloat16 has few enough digits to stay as it is, wherever a wrong sign
// of a rounded number could shut or open a ReLU: what differs then, differs by rounding alone.
#include "core/kernels/field_mlp_amx.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/kernels/field_mlp_simd.h"
#include "core/kernels/mlp_ref.h"
#include "tests/kernels/numeric.h"
#include "tests/kernels/padded_rows.h"

namespace fieldgraft {
namespace {

using testing::random_values;
using testing::rows_of;

// count numbers out of {−½, 0, ½}.
std::vector<double> halves(std::size_t count, unsigned seed) {
    std::vector<double> values = random_values<double>(count, seed);
    for (double& v : values) v = std::round(v) / 2;
    return values;
}

// What rows_of lays out, feature-major again.
std::vector<double> columns_of(const std::vector<float>& rows, int width, int row, int n) {
    std::vector<double> columns(std::size_t(width) * n);
    for (int s = 0; s < n; ++s) {
        for (int i = 0; i < width; ++i) columns[std::size_t(i) * n + s] = double(rows[std::size_t(s) * row + i]);
    }
    return columns;
}

void expect_near(const std::vector<double>& found, const std::vector<double>& expected, double share,
                 const char* what) {
    ASSERT_EQ(found.size(), expected.size()) << what;
    double largest = 0;
    for (const double e : expected) largest = std::max(largest, std::abs(e));
    for (std::size_t i = 0; i < found.size(); ++i) {
        ASSERT_LE(std::abs(found[i] - expected[i]), share * largest) << what << ' ' << i;
    }
}

struct Case {
    FieldMlpShape shape;
    int samples;
};

class FieldMlpAmx : public ::testing::TestWithParam<Case> {
  protected:
    void SetUp() override {
        if (!amx::available()) GTEST_SKIP() << "this machine has no AMX tiles";
    }
};

struct Networks {
    FieldMlpShape shape;
    std::vector<std::vector<double>> matrices;
    FieldMlpWeights weights;
    FieldMlpGradients gradients;

    explicit Networks(const FieldMlpShape& s) : shape(s), weights(s, Precision::bfloat16), gradients(s) {
        unsigned seed = 1;
        std::vector<std::vector<float>> single;
        for (const auto& [out, in] : s.matrices()) {
            matrices.push_back(halves(std::size_t(out * in), seed++));
            single.emplace_back(matrices.back().begin(), matrices.back().end());
        }
        weights.pack(FieldMlpMatrices(single.begin(), single.end()));
    }
    std::vector<std::span<const double>> spans(int first, int count) const {
        return {matrices.begin() + first, matrices.begin() + first + count};
    }
    std::vector<std::vector<double>> found_gradients() const {
        std::vector<std::vector<float>> found;
        for (const auto& m : matrices) found.emplace_back(m.size(), 0.0f);
        gradients.add_to(shape, std::vector<std::span<float>>(found.begin(), found.end()));
        std::vector<std::vector<double>> result;
        for (const auto& m : found) result.emplace_back(m.begin(), m.end());
        return result;
    }
};

TEST_P(FieldMlpAmx, DensityNetworkIsExactWhereNothingNeedsRounding) {
    const auto& [shape, n] = GetParam();
    Networks net(shape);
    ASSERT_EQ(net.weights.precision(), Precision::bfloat16);
    const MlpShape layers{{shape.encoded, shape.hidden, shape.features}};
    const auto encoded = halves(std::size_t(shape.encoded) * n, 10),
               features_grad = halves(std::size_t(shape.features) * n, 11);
    std::vector<std::vector<double>> hidden;
    mlp_forward<double>(layers, net.spans(0, 2), encoded, hidden);
    std::vector<std::vector<double>> grads;
    for (const auto& m : net.matrices) grads.emplace_back(m.size(), 0.0);
    std::vector<double> encoded_grad(encoded.size());
    mlp_backward<double>(layers, net.spans(0, 2), encoded, hidden, features_grad, {grads[0], grads[1]}, encoded_grad);

    const int e = padded(shape.encoded), f = padded(shape.features);
    const auto encoded_rows = rows_of(encoded, shape.encoded, n), grad_rows = rows_of(features_grad, shape.features, n);
    std::vector<float> features(std::size_t(n) * f, NAN), found(std::size_t(n) * e, NAN);
    density_mlp_forward(net.weights, encoded_rows.data(), n, features.data());
    density_mlp_backward(net.weights, encoded_rows.data(), grad_rows.data(), n, net.gradients, found.data());
    EXPECT_EQ(columns_of(features, shape.features, f, n), hidden.back());
    EXPECT_EQ(columns_of(found, shape.encoded, e, n), encoded_grad);
    const auto found_grads = net.found_gradients();
    EXPECT_EQ(found_grads[0], grads[0]);
    EXPECT_EQ(found_grads[1], grads[1]);
}

TEST_P(FieldMlpAmx, ColorNetworkEqualsTheReferenceUpToRounding) {
    const auto& [shape, n] = GetParam();
    Networks net(shape);
    const int rays = std::max(1, n / 5), c = padded(shape.color_hidden), f = padded(shape.features);
    const auto features = halves(std::size_t(shape.features) * n, 12),
               basis = halves(std::size_t(shape.basis) * rays, 13);
    std::vector<std::int32_t> ray;
    for (int i = 0; i < n; ++i) ray.push_back((i * 7 + i / 5) % rays);
    std::vector<double> input;
    for (int b = 0; b < shape.basis; ++b) {
        for (int s = 0; s < n; ++s) input.push_back(basis[std::size_t(b) * rays + ray[s]]);
    }
    input.insert(input.end(), features.begin(), features.end());
    const MlpShape layers{{shape.basis + shape.features, shape.color_hidden, shape.color_hidden, 3}};
    std::vector<std::vector<double>> hidden;
    mlp_forward<double>(layers, net.spans(2, 3), input, hidden);
    std::vector<double> color = hidden.back();
    for (double& x : color) x = 1 / (1 + std::exp(-x));

    const auto features_rows = rows_of(features, shape.features, n), basis_rows = rows_of(basis, shape.basis, rays);
    std::vector<float> base(std::size_t(rays) * c), hidden0(std::size_t(n) * c, NAN), hidden1 = hidden0,
                                                                                      found(3 * std::size_t(n), NAN);
    ray_color_base(net.weights, basis_rows.data(), rays, base.data());
    color_mlp_forward(net.weights, features_rows.data(), ray.data(), base.data(), n, hidden0.data(), hidden1.data(),
                      found.data());
    EXPECT_EQ(columns_of(hidden0, shape.color_hidden, c, n), hidden[0]);
    expect_near(columns_of(hidden1, shape.color_hidden, c, n), hidden[1], 0.01, "second hidden layer");
    expect_near(columns_of(found, 3, 3, n), color, 0.05, "color");

    // The gradient is taken at the reference's colours, as those near 0 and 1 have few digits left.
    const auto color_grad = halves(3 * std::size_t(n), 14);
    std::vector<double> logit_grad(color.size());
    for (std::size_t i = 0; i < color.size(); ++i) logit_grad[i] = color_grad[i] * color[i] * (1 - color[i]);
    std::vector<std::vector<double>> grads;
    for (const auto& m : net.matrices) grads.emplace_back(m.size(), 0.0);
    std::vector<double> input_grad(input.size());
    mlp_backward<double>(layers, net.spans(2, 3), input, hidden, logit_grad, {grads[2], grads[3], grads[4]},
                         input_grad);
    const std::vector<double> features_grad(input_grad.begin() + std::ptrdiff_t(shape.basis) * n, input_grad.end());
    const auto three = [&](const std::vector<double>& columns) {
        std::vector<float> rows(3 * std::size_t(n));
        for (int s = 0; s < n; ++s) {
            for (int i = 0; i < 3; ++i) rows[3 * s + i] = float(columns[std::size_t(i) * n + s]);
        }
        return rows;
    };
    std::vector<float> base_grad(base.size(), 0.0f), found_features(std::size_t(n) * f, NAN);
    const auto at = three(color), slope = three(color_grad);
    color_mlp_backward(net.weights, features_rows.data(), ray.data(), hidden0.data(), hidden1.data(), at.data(),
                       slope.data(), n, net.gradients, base_grad.data(), found_features.data());
    ray_color_base_backward(net.weights, basis_rows.data(), base_grad.data(), rays, net.gradients);
    expect_near(columns_of(found_features, shape.features, f, n), features_grad, 0.01, "features");
    const auto found_grads = net.found_gradients();
    for (int i = 2; i < 5; ++i) expect_near(found_grads[i], grads[i], 0.01, "matrix");
}

INSTANTIATE_TEST_SUITE_P(ShapesAndCounts, FieldMlpAmx,
                         ::testing::Values(Case{{32, 64, 16, 16, 64}, 0}, Case{{32, 64, 16, 16, 64}, 1},
                                           Case{{32, 64, 16, 16, 64}, 32}, Case{{32, 64, 16, 16, 64}, 131},
                                           Case{{32, 64, 16, 16, 64}, 300}, Case{{16, 32, 16, 9, 32}, 77},
                                           Case{{24, 48, 7, 4, 20}, 53}, Case{{12, 112, 40, 16, 128}, 65}));

TEST(FieldMlpAmxHardInputs, NaNIsNotHiddenAndOtherSamplesAreNotTouched) {
    if (!amx::available()) GTEST_SKIP() << "this machine has no AMX tiles";
    const FieldMlpShape shape;
    const int n = 70;
    const Networks net(shape);
    const int e = padded(shape.encoded), f = padded(shape.features);
    auto rows = rows_of(halves(std::size_t(shape.encoded) * n, 15), shape.encoded, n);
    std::vector<float> clean(std::size_t(n) * f), found = clean;
    density_mlp_forward(net.weights, rows.data(), n, clean.data());
    rows[std::size_t(n / 2) * e] = std::numeric_limits<float>::quiet_NaN();
    density_mlp_forward(net.weights, rows.data(), n, found.data());
    for (int s = 0; s < n; ++s) {
        for (int i = 0; i < shape.features; ++i) {
            const float value = found[std::size_t(s) * f + i];
            if (s == n / 2) {
                EXPECT_TRUE(std::isnan(value));
            } else {
                EXPECT_EQ(value, clean[std::size_t(s) * f + i]);
            }
        }
    }
}

TEST(FieldMlpAmxChoice, WideNetworksStayInFloat32) {
    EXPECT_EQ(FieldMlpWeights({32, 256, 16, 16, 64}, Precision::bfloat16).precision(), Precision::float32);
    EXPECT_EQ(FieldMlpWeights({32, 64, 16, 16, 64}).precision(), Precision::float32);
}

}  // namespace
}  // namespace fieldgraft
