// Numbers one at a time: α and e⁻ᵃ, φ of the conserving weights, softplus and the bounded sigmoid of the edit's
// network.
#include <gtest/gtest.h>

#include "core/kernels/edit_mlp_simd.h"
#include "core/kernels/exp_simd.h"
#include "core/kernels/phi.h"
#include "tests/kernels/simd_targets.h"
#include "tests/stability/big.h"
#include "tests/stability/hard_rays.h"
#include "tests/stability/ledger.h"

namespace fieldgraft::stability {
namespace {

TEST(Alpha, ValueAndGradient) {
    std::vector<float> a = hard_depths();
    for (float x = 1e-37f; x < 1e5f; x *= 1.37f) a.push_back(x);
    std::vector<float> covered(a.size()), passed(a.size());
    const auto check = [&](const std::string& path, const BlendMath<float>& math) {
        math.covered(a.data(), a.size(), covered.data());
        math.passed(a.data(), a.size(), passed.data());
        for (std::size_t i = 0; i < a.size(); ++i) {
            const Big depth = std::min(a[i], 1e30f), alpha = minus_expm1_of(-depth), left = exp_of(-depth);
            const float naive = std::exp(-a[i]);
            ledger().add("α", "value", path, depth_class(a[i]), error_of(covered[i], alpha, alpha, smallest),
                         error_of(1 - naive, alpha, alpha, smallest));
            ledger().add("α", "gradient", path, depth_class(a[i]), error_of(passed[i], left, left, smallest),
                         error_of(naive, left, left, smallest));
        }
    };
    check("reference", library_math<float>());
    testing::on_every_target([&] { check("SIMD", {exp_negative, one_minus_exp_negative}); });
}

TEST(Phi, ValueAndGradient) {
    std::vector<float> depths = hard_depths();
    depths.pop_back();  // depths are clamped before
    for (float x = 1e-37f; x < 1e29f; x *= 1.37f) depths.push_back(x);
    for (const float a : depths) {
        const Big x = a, share = oracle::share(x, minus_expm1_of(-x));
        // φ' = (e⁻ˣ − φ)/x, by its series where that cancels at 50 digits.
        const Big slope =
            a < 1e-10f ? Big(-Big(1) / 2 + x / 3 - x * x / 8 + x * x * x / 30) : Big((exp_of(-x) - share) / x);
        const float naive = (1 - std::exp(-a)) / a;
        const Big unit = boost::multiprecision::abs(slope);
        ledger().add("φ of the conserving weights", "value", "reference", depth_class(a),
                     error_of(phi(a), share, share, smallest), error_of(naive, share, share, smallest));
        ledger().add("φ of the conserving weights", "gradient", "reference", depth_class(a),
                     error_of(phi_derivative(a), slope, unit, smallest),
                     error_of((std::exp(-a) - naive) / a, slope, unit, smallest));
    }
}

// A network whose one hidden unit is 1, so that z is the output's weight.
struct OneUnit {
    EditMlpShape shape;
    std::vector<float> hidden{1}, hidden_bias{0}, output, output_bias{0}, encoded{1};

    OneUnit(EditActivation activation, float z) : output{z} {
        shape.encoded = shape.hidden = 1;
        shape.outputs = {activation};
    }
    EditMlpMatrices<const float> matrices() const { return {hidden, hidden_bias, output, output_bias}; }

    // y and dy/dz (the bias' gradient).
    std::pair<float, float> reference() const {
        std::vector<float> y(1), grads(4), encoded_grad(1);
        const std::vector<float> one{1};
        edit_mlp_forward<float>(shape, matrices(), encoded, y);
        edit_mlp_backward<float>(shape, matrices(), encoded, one,
                                 {{&grads[0], 1}, {&grads[1], 1}, {&grads[2], 1}, {&grads[3], 1}}, encoded_grad);
        return {y[0], grads[3]};
    }
    std::pair<float, float> simd() const {
        const EditMlpWeights weights(shape, matrices());
        std::vector<float> row(static_cast<std::size_t>(weights.row()), 0.0f), row_grad(row.size());
        row[0] = row[1] = 1;
        float y = 0;
        const float one = 1;
        const std::int64_t first = 0;
        EditColumns<float> out{};
        EditColumns<const float> in{};
        out.data[0] = &y;
        in.data[0] = &one;
        out.step[0] = in.step[0] = 1;
        out.index = in.index = &first;
        edit_mlp_forward(weights, row.data(), 1, out);
        EditMlpGradients gradients(weights);
        edit_mlp_backward(weights, row.data(), 1, in, gradients, row_grad.data());
        return {y, gradients.last_bias[0]};
    }
};

std::string logit_class(float z) {
    const float size = std::abs(z);
    return size <= 1e-3f ? "z near 0" : size <= 20 ? "z within ±20" : size <= 104 ? "z within ±104" : "z within ±1e30";
}

struct Activation {
    std::string name;
    EditActivation kind;
    Big (*value)(const Big&);
    Big (*slope)(const Big&);
    float (*naive)(float);
    float (*naive_slope)(float);
};

Big tanh_of(const Big& u) {
    const Big q = exp_of(-2 * boost::multiprecision::abs(u)),
              t = minus_expm1_of(-2 * boost::multiprecision::abs(u)) / (1 + q);
    return u < 0 ? Big(-t) : t;
}

Big bounded_slope(const Big& z) {
    const Big u = z / 8, q = exp_of(-2 * boost::multiprecision::abs(u)), y = sigmoid_of(8 * tanh_of(u));
    return y * (1 - y) * 4 * q / ((1 + q) * (1 + q));
}

TEST(EditActivations, ValueAndGradient) {
    const std::vector<Activation> all{
        {"softplus (density of g)", EditActivation::softplus, softplus_of, sigmoid_of,
         [](float z) { return std::log(1 + std::exp(z)); }, [](float z) { return std::exp(z) / (1 + std::exp(z)); }},
        {"bounded sigmoid (β, colour of g)", EditActivation::bounded,
         [](const Big& z) { return sigmoid_of(8 * tanh_of(z / 8)); }, bounded_slope,
         [](float z) { return 1 / (1 + std::exp(-8 * std::tanh(z / 8))); },
         [](float z) {
             const float t = std::tanh(z / 8), y = 1 / (1 + std::exp(-8 * t));
             return y * (1 - y) * (1 - t * t);
         }}};
    std::vector<float> logits{0, 1e-38f, 1e-8f, 1e-4f, 87, 88, 89, 103, 104, 200, 1e4f, 1e30f};
    for (float z = 1e-3f; z < 110; z *= 1.21f) logits.push_back(z);
    for (const Activation& activation : all) {
        for (const float size : logits) {
            for (const float z : {size, -size}) {
                const Big value = activation.value(z), slope = activation.slope(z);
                const OneUnit unit(activation.kind, z);
                const auto check = [&](const std::string& path, const std::pair<float, float>& found) {
                    // e^−z has an error of |z| ε.
                    const Big more = 1 + std::min(std::abs(z), 200.0f);
                    ledger().add(activation.name, "value", path, logit_class(z),
                                 error_of(found.first, value, value * more, smallest),
                                 error_of(activation.naive(z), value, value * more, smallest));
                    ledger().add(activation.name, "gradient", path, logit_class(z),
                                 error_of(found.second, slope, slope * more, smallest),
                                 error_of(activation.naive_slope(z), slope, slope * more, smallest));
                };
                check("reference", unit.reference());
                testing::on_every_target([&] { check("SIMD", unit.simd()); });
            }
        }
    }
}

}  // namespace
}  // namespace fieldgraft::stability
