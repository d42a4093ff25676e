// The field's networks against 50 digits: float32 (reference and SIMD) and bfloat16 tiles where the machine has them.
// For the tiles weights and inputs have few digits, so that rounding them is exact: what differs comes from the layers
// between.
#include <gtest/gtest.h>

#include "core/kernels/field_mlp_simd.h"
#include "core/kernels/mlp_ref.h"
#include "tests/kernels/numeric.h"
#include "tests/kernels/padded_rows.h"
#include "tests/kernels/simd_targets.h"
#include "tests/stability/big.h"
#include "tests/stability/ledger.h"

namespace fieldgraft::stability {
namespace {

using Bigs = std::vector<Big>;

// Eighths between low and 1.
std::vector<double> eighths(std::size_t count, unsigned seed, double low = -1) {
    std::vector<double> values = testing::random_values<double>(count, seed, low, 1);
    for (double& v : values) v = std::round(8 * v) / 8;
    return values;
}

Big size_of(const Big& x) {
    return boost::multiprecision::abs(x);
}

// y += W x for one sample, and with sizes in place of values.
Bigs product(const std::vector<double>& matrix, const Bigs& x, bool sizes = false) {
    Bigs y(matrix.size() / x.size(), Big(0));
    for (std::size_t o = 0; o < y.size(); ++o) {
        for (std::size_t i = 0; i < x.size(); ++i) {
            const Big part = x[i] * matrix[o * x.size() + i];
            y[o] += sizes ? size_of(part) : part;
        }
    }
    return y;
}

Bigs transposed_product(const std::vector<double>& matrix, const Bigs& y, bool sizes = false) {
    Bigs x(matrix.size() / y.size(), Big(0));
    for (std::size_t o = 0; o < y.size(); ++o) {
        for (std::size_t i = 0; i < x.size(); ++i) {
            const Big part = y[o] * matrix[o * x.size() + i];
            x[i] += sizes ? size_of(part) : part;
        }
    }
    return x;
}

// Two layers with a ReLU between them: values, gradients of input and matrices for a gradient of the output, and units.
struct DensityOracle {
    std::vector<Bigs> features, features_unit, input_grad, input_grad_unit;  // of each sample
    std::array<Bigs, 2> matrix_grad, matrix_unit;

    DensityOracle(const std::array<std::vector<double>, 2>& w, const std::vector<Bigs>& in,
                  const std::vector<Bigs>& g) {
        for (int m : {0, 1}) {
            matrix_grad[m].resize(w[m].size());
            matrix_unit[m].resize(w[m].size());
        }
        for (std::size_t s = 0; s < in.size(); ++s) {
            Bigs hidden = product(w[0], in[s]), hidden_unit = product(w[0], in[s], true);
            Bigs back = transposed_product(w[1], g[s]), back_unit = transposed_product(w[1], g[s], true);
            for (std::size_t h = 0; h < hidden.size(); ++h) {
                if (hidden[h] <= 0) hidden[h] = back[h] = back_unit[h] = 0;
                if (hidden[h] <= 0) hidden_unit[h] = 0;
            }
            features.push_back(product(w[1], hidden));
            features_unit.push_back(product(w[1], hidden_unit, true));
            input_grad.push_back(transposed_product(w[0], back));
            input_grad_unit.push_back(transposed_product(w[0], back_unit, true));
            add_outer(0, back, back_unit, in[s], in[s]);
            add_outer(1, g[s], g[s], hidden, hidden_unit);
        }
    }

  private:
    void add_outer(int m, const Bigs& out, const Bigs& out_unit, const Bigs& in, const Bigs& in_unit) {
        for (std::size_t o = 0; o < out.size(); ++o) {
            for (std::size_t i = 0; i < in.size(); ++i) {
                matrix_grad[m][o * in.size() + i] += out[o] * in[i];
                matrix_unit[m][o * in.size() + i] += size_of(out_unit[o] * in_unit[i]);
            }
        }
    }
};

constexpr int samples = 9;

struct DensityCase {
    FieldMlpShape shape;
    std::array<std::vector<double>, 2> w;
    std::vector<double> encoded, features_grad;  // feature-major
    std::string input;

    DensityCase(std::string name, double scale, bool few_digits) : input(std::move(name)) {
        const auto numbers = [&](std::size_t count, unsigned seed) {
            if (few_digits) return eighths(count, seed);
            const auto single = testing::random_values<float>(count, seed);
            return std::vector<double>(single.begin(), single.end());
        };
        w = {numbers(std::size_t(shape.hidden * shape.encoded), 1),
             numbers(std::size_t(shape.features * shape.hidden), 2)};
        encoded = numbers(std::size_t(shape.encoded) * samples, 3);
        for (double& e : encoded) e *= scale;
        features_grad = numbers(std::size_t(shape.features) * samples, 4);
    }
    static std::vector<Bigs> by_sample(const std::vector<double>& columns) {
        std::vector<Bigs> rows(samples);
        for (std::size_t i = 0; i < columns.size(); ++i) rows[i % samples].push_back(columns[i]);
        return rows;
    }
};

struct Found {
    std::vector<float> features, input_grad;  // feature-major
    std::array<std::vector<float>, 2> matrix_grad;
};

std::vector<float> columns_of(const std::vector<float>& rows, int width) {
    std::vector<float> columns(std::size_t(width) * samples);
    for (int s = 0; s < samples; ++s)
        for (int i = 0; i < width; ++i)
            columns[std::size_t(i) * samples + s] = rows[std::size_t(s) * padded(width) + i];
    return columns;
}

Found found_by_reference(const DensityCase& c) {
    const std::array<std::vector<float>, 2> w{std::vector<float>(c.w[0].begin(), c.w[0].end()),
                                              std::vector<float>(c.w[1].begin(), c.w[1].end())};
    const std::vector<float> in(c.encoded.begin(), c.encoded.end()), g(c.features_grad.begin(), c.features_grad.end());
    const MlpShape shape{{c.shape.encoded, c.shape.hidden, c.shape.features}};
    std::vector<std::vector<float>> layers;
    Found out;
    for (int m : {0, 1}) out.matrix_grad[m].resize(w[m].size());
    out.input_grad.resize(in.size());
    mlp_forward<float>(shape, {w[0], w[1]}, in, layers);
    out.features = layers.back();
    mlp_backward<float>(shape, {w[0], w[1]}, in, layers, g, {out.matrix_grad[0], out.matrix_grad[1]}, out.input_grad);
    return out;
}

Found found_by_kernels(const DensityCase& c, Precision precision) {
    FieldMlpWeights weights(c.shape, precision);
    std::vector<std::vector<float>> matrices;
    for (const auto& [out, in] : c.shape.matrices()) matrices.emplace_back(std::size_t(out * in), 0.0f);
    for (int m : {0, 1}) matrices[m].assign(c.w[m].begin(), c.w[m].end());
    weights.pack(FieldMlpMatrices(matrices.begin(), matrices.end()));
    const auto rows = testing::rows_of(c.encoded, c.shape.encoded, samples),
               grad_rows = testing::rows_of(c.features_grad, c.shape.features, samples);
    std::vector<float> features(std::size_t(samples) * padded(c.shape.features)), input_grad(rows.size());
    FieldMlpGradients gradients(c.shape);
    density_mlp_forward(weights, rows.data(), samples, features.data());
    density_mlp_backward(weights, rows.data(), grad_rows.data(), samples, gradients, input_grad.data());
    for (auto& matrix : matrices) std::fill(matrix.begin(), matrix.end(), 0.0f);
    gradients.add_to(c.shape, std::vector<std::span<float>>(matrices.begin(), matrices.end()));
    return {
        columns_of(features, c.shape.features), columns_of(input_grad, c.shape.encoded), {matrices[0], matrices[1]}};
}

void compare(const DensityCase& c, const DensityOracle& right, const Found& found, const std::string& path) {
    const auto add = [&](const char* quantity, const char* part, float got, const Big& value, const Big& unit) {
        ledger().add(quantity, part, path, c.input, error_of(got, value, unit, smallest * 4096));
    };
    for (int s = 0; s < samples; ++s) {
        for (std::size_t i = 0; i < right.features[s].size(); ++i)
            add("density network", "value", found.features[i * samples + s], right.features[s][i],
                right.features_unit[s][i]);
        for (std::size_t i = 0; i < right.input_grad[s].size(); ++i)
            add("density network", "gradient", found.input_grad[i * samples + s], right.input_grad[s][i],
                right.input_grad_unit[s][i]);
    }
    for (int m : {0, 1}) {
        for (std::size_t i = 0; i < right.matrix_grad[m].size(); ++i)
            add("density network, its matrices", "gradient", found.matrix_grad[m][i], right.matrix_grad[m][i],
                right.matrix_unit[m][i]);
    }
}

TEST(DensityNetwork, ValuesAndGradients) {
    for (const auto& [name, scale] : {std::pair{"inputs near 1", 1.0},
                                      {"inputs near 1e-6", 0x1p-20},
                                      {"inputs near 1e4", 0x1p13},
                                      {"inputs near 1e-30", 0x1p-100},
                                      {"denormal inputs", 0x1p-130}}) {
        const auto check = [&](bool few_digits, auto&& compare_with) {
            const DensityCase c(name, scale, few_digits);
            compare_with(
                c, DensityOracle(c.w, DensityCase::by_sample(c.encoded), DensityCase::by_sample(c.features_grad)));
        };
        check(false, [](const DensityCase& c, const DensityOracle& right) {
            compare(c, right, found_by_reference(c), "reference");
            testing::on_every_target([&] { compare(c, right, found_by_kernels(c, Precision::float32), "SIMD"); });
        });
        if (!amx::available()) continue;
        check(true, [](const DensityCase& c, const DensityOracle& right) {
            compare(c, right, found_by_kernels(c, Precision::bfloat16), "bfloat16");
        });
    }
}

// The colour network with nothing negative in it, so that no ReLU shuts: logits of each sample and their derivatives.
struct ColorCase {
    FieldMlpShape shape;
    std::array<std::vector<double>, 3> w;  // V₀'s part of the features, V₁, V₂
    std::vector<double> features, color_grad;
    std::vector<Bigs> color, color_unit, features_grad, features_unit;

    ColorCase() {
        const auto scaled = [](std::vector<double> values, double by) {
            for (double& v : values) v *= by;
            return values;
        };
        w = {scaled(eighths(std::size_t(shape.color_hidden * shape.features), 1, 0), 0x1p-4),
             scaled(eighths(std::size_t(shape.color_hidden * shape.color_hidden), 2, 0), 0x1p-5),
             scaled(eighths(std::size_t(3 * shape.color_hidden), 3), 0x1p-2)};
        features = eighths(std::size_t(shape.features) * samples, 4, 0);
        color_grad = eighths(std::size_t(3) * samples, 5);
        const auto in = DensityCase::by_sample(features), g = DensityCase::by_sample(color_grad);
        for (int s = 0; s < samples; ++s) {
            const Bigs hidden = product(w[1], product(w[0], in[s])), logits = product(w[2], hidden),
                       size = product(w[2], hidden, true);
            Bigs shown(3), unit(3), grad(3), grad_unit(3);
            for (int c = 0; c < 3; ++c) {
                shown[c] = sigmoid_of(logits[c]);
                const Big slope = shown[c] * (1 - shown[c]);
                unit[c] = shown[c] + slope * size[c];
                grad[c] = slope * g[s][c];
                grad_unit[c] = size_of(grad[c]) * (1 + size[c]);
            }
            color.push_back(shown);
            color_unit.push_back(unit);
            const auto back = [&](const Bigs& of, bool sizes) {
                return transposed_product(w[0], transposed_product(w[1], transposed_product(w[2], of, sizes), sizes),
                                          sizes);
            };
            features_grad.push_back(back(grad, false));
            features_unit.push_back(back(grad_unit, true));
        }
    }
};

void compare_color(const ColorCase& c, Precision precision, const std::string& path) {
    FieldMlpWeights weights(c.shape, precision);
    std::vector<std::vector<float>> matrices;
    for (const auto& [out, in] : c.shape.matrices()) matrices.emplace_back(std::size_t(out * in), 0.0f);
    const std::size_t width = std::size_t(c.shape.basis + c.shape.features);
    for (std::size_t i = 0; i < c.w[0].size(); ++i) {
        const std::size_t row = i / c.shape.features, column = i % c.shape.features;
        matrices[2][row * width + c.shape.basis + column] = static_cast<float>(c.w[0][i]);
    }
    for (int m : {1, 2}) matrices[m + 2].assign(c.w[m].begin(), c.w[m].end());
    weights.pack(FieldMlpMatrices(matrices.begin(), matrices.end()));
    const auto rows = testing::rows_of(c.features, c.shape.features, samples);
    const std::size_t hidden = std::size_t(samples) * padded(c.shape.color_hidden);
    const std::vector<std::int32_t> ray(samples, 0);
    std::vector<float> base(padded(c.shape.color_hidden)), hidden0(hidden), hidden1(hidden), color(3 * samples),
        base_grad(base.size()), features_grad(rows.size()), color_grad(3 * samples);
    for (std::size_t i = 0; i < color_grad.size(); ++i)
        color_grad[i % samples * 3 + i / samples] = static_cast<float>(c.color_grad[i]);
    FieldMlpGradients gradients(c.shape);
    color_mlp_forward(weights, rows.data(), ray.data(), base.data(), samples, hidden0.data(), hidden1.data(),
                      color.data());
    color_mlp_backward(weights, rows.data(), ray.data(), hidden0.data(), hidden1.data(), color.data(),
                       color_grad.data(), samples, gradients, base_grad.data(), features_grad.data());
    for (int s = 0; s < samples; ++s) {
        for (int i = 0; i < 3; ++i)
            ledger().add("colour network", "value", path, "inputs near 1",
                         error_of(color[3 * s + i], c.color[s][i], c.color_unit[s][i]));
        for (int i = 0; i < c.shape.features; ++i)
            ledger().add("colour network", "gradient", path, "inputs near 1",
                         error_of(features_grad[std::size_t(s) * padded(c.shape.features) + i], c.features_grad[s][i],
                                  c.features_unit[s][i]));
    }
}

TEST(ColorNetwork, ValuesAndGradients) {
    const ColorCase c;
    testing::on_every_target([&] { compare_color(c, Precision::float32, "SIMD"); });
    if (amx::available()) compare_color(c, Precision::bfloat16, "bfloat16");
}

}  // namespace
}  // namespace fieldgraft::stability
