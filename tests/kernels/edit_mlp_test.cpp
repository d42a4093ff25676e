#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/kernels/edit_mlp_simd.h"
#include "tests/kernels/numeric.h"
#include "tests/kernels/simd_targets.h"

namespace fieldgraft {
namespace {

using testing::on_every_target;
using testing::random_values;
using enum EditActivation;

// Random matrices and samples, in double and rounded to float first: both sides see the same numbers.
struct Case {
    EditMlpShape shape;
    std::size_t n;
    std::vector<std::vector<double>> matrices;
    std::vector<double> encoded, y_grad;

    Case(EditMlpShape s, std::size_t samples) : shape(std::move(s)), n(samples) {
        const std::size_t e = shape.encoded, h = shape.hidden, k = shape.outputs.size();
        const auto rounded = [](std::size_t count, unsigned seed, double reach) {
            const auto values = random_values<float>(count, seed, -reach, reach);
            return std::vector<double>(values.begin(), values.end());
        };
        matrices = {rounded(h * e, 1, 0.7), rounded(h, 2, 0.4), rounded(k * h, 3, 0.7), rounded(k, 4, 2)};
        encoded = rounded(n * e, 5, 1);
        y_grad = rounded(n * k, 6, 1);
    }
    EditMlpMatrices<const double> wide() const { return {matrices[0], matrices[1], matrices[2], matrices[3]}; }
    std::vector<double> forward() const {
        std::vector<double> y(n * shape.outputs.size());
        edit_mlp_forward<double>(shape, wide(), encoded, y);
        return y;
    }
    double loss() const { return testing::dot(forward(), y_grad); }
};

struct Gradients {
    std::vector<std::vector<double>> matrices;
    std::vector<double> encoded;

    explicit Gradients(const Case& c) : encoded(c.encoded.size()) {
        for (const auto& matrix : c.matrices) matrices.emplace_back(matrix.size());
        edit_mlp_backward<double>(c.shape, c.wide(), c.encoded, c.y_grad,
                                  {matrices[0], matrices[1], matrices[2], matrices[3]}, encoded);
    }
};

std::vector<Case> cases() {
    std::vector<Case> all;
    all.emplace_back(EditMlpShape{12, 64, {softplus, bounded, bounded, bounded, bounded, bounded}, 40}, 211);
    all.emplace_back(EditMlpShape{16, 20, {bounded}, 1}, 1);
    all.emplace_back(EditMlpShape{3, 5, {bounded, softplus}, 2}, 48);
    all.emplace_back(EditMlpShape{12, 64, {softplus}, 1}, 0);
    all.emplace_back(EditMlpShape{31, 33, std::vector<EditActivation>(16, bounded), 1}, 97);
    return all;
}

TEST(EditMlpReference, OneSampleInClosedForm) {
    const EditMlpShape shape{1, 2, {softplus, bounded}, 3};
    const std::vector<double> hidden{2, -1}, hidden_bias{0.5, 0.25}, output{1, 7, -2, 7}, output_bias{0.125, 0.5};
    const std::vector<double> e{0.75};
    std::vector<double> y(2);
    edit_mlp_forward<double>(shape, {hidden, hidden_bias, output, output_bias}, e, y);
    // h = (2, 0), z = (2.125, −3.5)
    EXPECT_NEAR(y[0], 3 * std::log1p(std::exp(2.125)), 1e-12);
    EXPECT_NEAR(y[1], 1 / (1 + std::exp(8 * std::tanh(3.5 / 8))), 1e-12);
}

TEST(EditMlpReference, GradientsAgainstFiniteDifferences) {
    for (Case c : cases()) {
        if (c.n == 0 || c.n > 60) continue;
        const Gradients gradients(c);
        const auto check = [&](std::vector<double>& values, const std::vector<double>& found, const char* what) {
            for (std::size_t i = 0; i < values.size(); i += 1 + values.size() / 40) {
                const double slope = testing::slope(values[i], 1e-6, [&] { return c.loss(); });
                EXPECT_NEAR(found[i], slope, 2e-6 * (1 + std::abs(slope))) << what << " " << i;
            }
        };
        check(c.encoded, gradients.encoded, "encoded");
        for (std::size_t m = 0; m < 4; ++m) check(c.matrices[m], gradients.matrices[m], "matrix");
    }
}

// What the kernels take, and a check that they leave everything else alone: sample s lies at 2 s + 1.
struct Narrow {
    const Case& c;
    std::vector<std::vector<float>> matrices;
    EditMlpWeights weights;
    std::vector<float> rows;
    std::vector<std::int64_t> index;

    explicit Narrow(const Case& from)
        : c(from),
          matrices(narrowed(from.matrices)),
          weights(c.shape, {matrices[0], matrices[1], matrices[2], matrices[3]}),
          rows(c.n * weights.row()),
          index(c.n) {
        for (std::size_t s = 0; s < c.n; ++s) {
            for (int i = 0; i < c.shape.encoded; ++i)
                rows[s * weights.row() + i] = static_cast<float>(c.encoded[s * c.shape.encoded + i]);
            rows[s * weights.row() + c.shape.encoded] = 1;
            index[s] = static_cast<std::int64_t>(2 * s + 1);
        }
    }
    static std::vector<std::vector<float>> narrowed(const std::vector<std::vector<double>>& wide) {
        std::vector<std::vector<float>> all;
        for (const auto& values : wide) all.emplace_back(values.begin(), values.end());
        return all;
    }
    std::size_t outputs() const { return c.shape.outputs.size(); }
    // Outputs as one array of rows, one row of `outputs` a sample.
    template <class T>
    EditColumns<T> columns(T* all) const {
        EditColumns<T> columns;
        columns.index = index.data();
        for (std::size_t k = 0; k < outputs(); ++k) columns.data[k] = all + k, columns.step[k] = outputs();
        return columns;
    }
};

TEST(EditMlpSimd, ForwardEqualsTheReference) {
    for (const Case& c : cases()) {
        const Narrow narrow(c);
        const std::vector<double> expected = c.forward();
        on_every_target([&] {
            std::vector<float> y((2 * c.n + 1) * narrow.outputs(), 77);
            edit_mlp_forward(narrow.weights, narrow.rows.data(), static_cast<int>(c.n), narrow.columns(y.data()));
            for (std::size_t s = 0; s < 2 * c.n + 1; ++s) {
                for (std::size_t k = 0; k < narrow.outputs(); ++k) {
                    const float found = y[s * narrow.outputs() + k];
                    if (s % 2 == 0) {
                        ASSERT_EQ(found, 77) << "wrote a sample that was not asked";
                    } else {
                        const double want = expected[s / 2 * narrow.outputs() + k];
                        ASSERT_NEAR(found, want, 4e-6 * (1 + std::abs(want))) << s << " " << k;
                    }
                }
            }
        });
    }
}

TEST(EditMlpSimd, BackwardEqualsTheReference) {
    for (const Case& c : cases()) {
        const Narrow narrow(c);
        const Gradients expected(c);
        std::vector<float> y_grad((2 * c.n + 1) * narrow.outputs(), NAN);
        for (std::size_t i = 0; i < c.y_grad.size(); ++i) {
            y_grad[(i / narrow.outputs() * 2 + 1) * narrow.outputs() + i % narrow.outputs()] =
                static_cast<float>(c.y_grad[i]);
        }
        on_every_target([&] {
            EditMlpGradients sums(narrow.weights), twice(narrow.weights);
            std::vector<float> rows(narrow.rows.size(), NAN);
            edit_mlp_backward(narrow.weights, narrow.rows.data(), static_cast<int>(c.n),
                              narrow.columns<const float>(y_grad.data()), sums, rows.data());
            twice.add(sums);
            twice.add(sums);
            auto found = Narrow::narrowed(c.matrices);
            for (auto& values : found) std::fill(values.begin(), values.end(), 0.0f);
            twice.add_to(c.shape, {found[0], found[1], found[2], found[3]});
            for (std::size_t m = 0; m < 4; ++m) {
                for (std::size_t i = 0; i < found[m].size(); ++i) {
                    const double want = 2 * expected.matrices[m][i];
                    ASSERT_NEAR(found[m][i], want, 4e-5 * (1 + std::abs(want)) * c.shape.density_scale)
                        << m << " " << i;
                }
            }
            for (std::size_t s = 0; s < c.n; ++s) {
                for (int i = 0; i < c.shape.encoded; ++i) {
                    const double want = expected.encoded[s * c.shape.encoded + i];
                    ASSERT_NEAR(rows[s * narrow.weights.row() + i], want, 1e-5 * (1 + std::abs(want))) << s << " " << i;
                }
            }
        });
    }
}

TEST(EditMlpSimd, OutputsWithoutGradientCountAsZero) {
    const Case c = cases()[0];
    Case none = c;
    for (std::size_t i = 0; i < none.y_grad.size(); ++i) {
        if (i % 6 != 4) none.y_grad[i] = 0;
    }
    const Narrow narrow(none);
    const std::vector<float> y_grad(none.y_grad.begin(), none.y_grad.end());
    on_every_target([&] {
        std::vector<std::int64_t> in_order(c.n);
        std::iota(in_order.begin(), in_order.end(), 0);
        const auto encoded_grad = [&](const EditColumns<const float>& grads) {
            EditMlpGradients sums(narrow.weights);
            std::vector<float> rows(narrow.rows.size());
            edit_mlp_backward(narrow.weights, narrow.rows.data(), static_cast<int>(c.n), grads, sums, rows.data());
            return rows;
        };
        EditColumns<const float> all = narrow.columns<const float>(y_grad.data()), one = all;
        all.index = one.index = in_order.data();
        for (int k = 0; k < 6; ++k) {
            if (k != 4) one.data[k] = nullptr;
        }
        EXPECT_EQ(encoded_grad(all), encoded_grad(one));
    });
}

// Large and small z, and NaN: the stable forms hold, and NaN is not swallowed.
TEST(EditMlpSimd, HardInputs) {
    const EditMlpShape shape{1, 2, {softplus, bounded}, 1};
    const std::vector<float> hidden{1, -1}, hidden_bias{0, 0}, output{1, -1, 1, -1}, output_bias{0, 0};
    const EditMlpWeights weights(shape, {hidden, hidden_bias, output, output_bias});  // z = e
    const std::vector<float> inputs{0, 1e-30f, -1e-30f, 20, -20, 88, -88, 1e4f, -1e4f, 1e30f, -1e30f, NAN};
    std::vector<float> rows(inputs.size() * weights.row());
    std::vector<std::int64_t> index(inputs.size());
    std::iota(index.begin(), index.end(), 0);
    for (std::size_t s = 0; s < inputs.size(); ++s)
        rows[s * weights.row()] = inputs[s], rows[s * weights.row() + 1] = 1;
    on_every_target([&] {
        std::vector<float> density(inputs.size()), beta(inputs.size()), rows_grad(rows.size());
        EditColumns<float> out;
        out.index = index.data();
        out.data = {density.data(), beta.data()};
        out.step = {1, 1};
        edit_mlp_forward(weights, rows.data(), static_cast<int>(inputs.size()), out);
        const std::vector<float> ones(inputs.size(), 1.0f);
        EditColumns<const float> grads;
        grads.index = index.data();
        grads.data = {ones.data(), ones.data()};
        grads.step = {1, 1};
        EditMlpGradients sums(weights);
        edit_mlp_backward(weights, rows.data(), static_cast<int>(inputs.size()), grads, sums, rows_grad.data());
        for (std::size_t s = 0; s + 1 < inputs.size(); ++s) {
            const double z = inputs[s], soft = std::max(z, 0.0) + std::log1p(std::exp(-std::abs(z)));
            const double bound = 1 / (1 + std::exp(-8 * std::tanh(z / 8)));
            EXPECT_NEAR(density[s], soft, 4e-7 * soft + 1e-37) << z;
            EXPECT_NEAR(beta[s], bound, 4e-6 * bound) << z;
            EXPECT_TRUE(std::isfinite(rows_grad[s * weights.row()])) << z;
        }
        EXPECT_TRUE(std::isnan(density.back()));
        EXPECT_TRUE(std::isnan(beta.back()));
    });
}

TEST(EditMlpSimd, RefusesWrongSizes) {
    const std::vector<float> numbers(64, 0.0f);
    const auto some = [&](std::size_t count) { return std::span(numbers).first(count); };
    EXPECT_NO_THROW(EditMlpWeights({3, 4, {bounded}, 1}, {some(12), some(4), some(4), some(1)}));
    EXPECT_THROW(EditMlpWeights({3, 4, {bounded}, 1}, {some(11), some(4), some(4), some(1)}), std::invalid_argument);
    EXPECT_THROW(EditMlpWeights({3, 4, {}, 1}, {some(12), some(4), some(0), some(0)}), std::invalid_argument);
    EXPECT_THROW(EditMlpWeights({0, 4, {bounded}, 1}, {some(0), some(4), some(4), some(1)}), std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
