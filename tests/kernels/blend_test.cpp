#include <cmath>
#include <limits>
#include <sstream>

#include "core/kernels/exp_simd.h"
#include "core/kernels/phi.h"
#include "tests/kernels/blend_cases.h"
#include "tests/kernels/simd_targets.h"

namespace fieldgraft {
namespace {

using oracle::Dual;

const std::vector<double>& hard_depths() {
    static const std::vector<double> depths{
        0, 1e-38, 1e-12, 1e-7, 1e-3, 1, 20, 100, 1e4, 1e30, std::numeric_limits<double>::infinity()};
    return depths;
}
const std::vector<double> hard_betas{0, 1e-8, 0.5, 1 - 1e-7, 1};

TEST(Blend, OneSampleClosedForm) {
    Rays<double> rays;
    rays.add_sample(0.5, 2.0, 0.8, 3.0, 0.4, 0.25, 0.5);
    rays.end_ray();
    const double kept = 1 - std::exp(-0.75), edit = 1 - std::exp(-1.5);
    const BlendMode all{true, true, true, false, true};
    const auto out = forward(all, rays);
    EXPECT_NEAR(out.color[0], kept * 0.6 + edit * 0.4, 1e-14);
    EXPECT_NEAR(out.color_edit[0], (kept * 0.5 + edit) * 0.4, 1e-14);
    EXPECT_NEAR(out.alpha_edit[0], kept * 0.5 + edit, 1e-14);
    EXPECT_NEAR(out.added[0], edit, 1e-14);
    EXPECT_NEAR(out.changed[0], kept * 0.5, 1e-14);
    EXPECT_NEAR(out.removed[0], 0.25, 1e-14);
    EXPECT_NEAR(out.transmittance[0], std::exp(-2.25), 1e-15);

    const auto conserving = forward({true, true, true, true, true}, rays);
    const double alpha = 1 - std::exp(-2.25);
    EXPECT_NEAR(conserving.added[0], alpha * 1.5 / 2.25, 1e-14);
    EXPECT_NEAR(conserving.color[0], alpha * (0.75 * 0.6 + 1.5 * 0.4) / 2.25, 1e-14);
}

TEST(Blend, TwoSamplesClosedForm) {
    Rays<double> rays;
    rays.add_sample(1.0, 1.0, 0.5, 0.0, 0.0, 0.5, 0.0);
    rays.add_sample(1.0, 2.0, 1.0, 0.0, 0.0, 0.0, 0.0);
    rays.end_ray();
    const auto out = forward({false, true, false, false, false}, rays);
    const double a0 = 1 - std::exp(-0.5), a1 = 1 - std::exp(-2.0);
    EXPECT_NEAR(out.color[0], a0 * 0.5 + std::exp(-0.5) * a1, 1e-14);
    EXPECT_NEAR(out.transmittance[0], std::exp(-2.5), 1e-15);
    EXPECT_NEAR(out.removed[0], (std::exp(-0.5) - std::exp(-1.0)) * a1 / (1 - std::exp(-1.0) + a1), 1e-14);
}

TEST(Blend, AgreesWithOracleInDouble) {
    const Rays<double> rays = random_rays(1);
    for (const BlendMode& mode : all_modes()) {
        SCOPED_TRACE(name_of(mode));
        auto out = forward(mode, rays);
        for (std::int64_t r = 0; r < rays.rays(); ++r) {
            for (int c = 0; c < 3; ++c) {
                const auto expected = oracle::blend(mode, oracle_ray(rays, r, c));
                EXPECT_NEAR(out.color[3 * r + c], expected.color.value, 1e-13);
                EXPECT_NEAR(out.color_edit[3 * r + c], expected.color_edit.value, 1e-13);
            }
            const auto expected = oracle::blend(mode, oracle_ray(rays, r, 0));
            EXPECT_NEAR(out.alpha_edit[r], expected.alpha_edit.value, 1e-13);
            EXPECT_NEAR(out.transmittance[r], expected.transmittance.value, 1e-13);
            EXPECT_NEAR(out.added[r], expected.added.value, 1e-13);
            EXPECT_NEAR(out.removed[r], expected.removed.value, 1e-13);
            EXPECT_NEAR(out.changed[r], expected.changed.value, 1e-13);
        }
    }
}

// Gradients of Σ weight·output to every entry of every head, against central differences of the forward kernel.
void check_differences(const BlendMode& mode, Rays<double> rays, RayValues<double> weights) {
    const auto loss = [&] {
        auto out = forward(mode, rays);
        double sum = 0;
        for (std::size_t i = 0; i < out.all().size(); ++i) {
            for (std::size_t j = 0; j < out.all()[i]->size(); ++j) sum += (*out.all()[i])[j] * (*weights.all()[i])[j];
        }
        return sum;
    };
    const auto grads = backward(mode, rays, weights);
    for (int head = 0; head < 4; ++head) {
        for (std::size_t i = 0; has_head(mode, head) && i < rays.head(head).size(); ++i) {
            double& value = rays.head(head)[i];
            const double before = value, h = 1e-5;
            value = before + h;
            const double up = loss();
            value = before - h;
            const double down = loss();
            value = before;
            EXPECT_NEAR(grads[head][i], (up - down) / (2 * h), 2e-8) << "head " << head << " entry " << i;
        }
    }
}

TEST(Blend, ColorGradientsAgainstFiniteDifferences) {
    std::mt19937 engine(5);
    std::uniform_real_distribution<double> u(-1, 1);
    for (const BlendMode& mode : all_modes()) {
        SCOPED_TRACE(name_of(mode));
        RayValues<double> weights(5);
        for (auto* values : {&weights.color, &weights.color_edit, &weights.alpha_edit, &weights.transmittance}) {
            for (double& w : *values) w = u(engine);
        }
        check_differences(mode, random_rays(2), weights);
    }
}

// Each map's gradient equals its derivative by its own head, the others held, and is exactly 0 for the others.
TEST(Blend, MapsReachOnlyTheirOwnHead) {
    for (const BlendMode& mode : all_modes()) {
        for (const int map : {0, 2, 3}) {  // added → density_e, removed → beta_density, changed → beta_color
            if (!has_head(mode, map)) continue;
            SCOPED_TRACE(name_of(mode) + " map " + std::to_string(map));
            Rays<double> rays = random_rays(3);
            RayValues<double> weights(rays.rays());
            (map == 0 ? weights.added : map == 2 ? weights.removed : weights.changed).assign(rays.rays(), 1.0);
            const auto grads = backward(mode, rays, weights);
            for (int head = 0; head < 4; ++head) {
                if (!has_head(mode, head) || head == map) continue;
                for (const double g : grads[head]) ASSERT_EQ(g, 0) << "leaks into head " << head;
            }
            for (std::size_t i = 0; i < rays.head(map).size(); ++i) {
                const std::int64_t r =
                    std::upper_bound(rays.start.begin(), rays.start.end(), static_cast<std::int64_t>(i)) -
                    rays.start.begin() - 1;
                auto ray = oracle_ray(rays, r, 0);
                auto& values = map == 0 ? ray.density_e : map == 2 ? ray.beta_density : ray.beta_color;
                values[i - rays.start[r]].slope = 1;
                const auto expected = oracle::blend(mode, ray);
                const Dual& output = map == 0 ? expected.added : map == 2 ? expected.removed : expected.changed;
                ASSERT_NEAR(grads[map][i], output.slope, 1e-12) << "entry " << i;
            }
        }
    }
}

TEST(Blend, RemovedMapAsThePaperHasItDependsOnTheSampling) {
    const BlendMode paper{false, true, false, false, false}, visible{false, true, false, false, true};
    for (const int samples : {1, 2, 5, 50}) {  // K opaque samples, all removed: (K−1)/K
        Rays<double> rays;
        for (int k = 0; k < samples; ++k) rays.add_sample(1, 1e3, 1, 0, 0, 1, 0);
        rays.end_ray();
        EXPECT_NEAR(forward(paper, rays).removed[0], (samples - 1.0) / samples, 1e-12);
        EXPECT_NEAR(forward(visible, rays).removed[0], 1.0, 1e-12);
    }
    Rays<double> haze;  // depth 0.01 in 1000 samples, all removed: about half of it
    for (int k = 0; k < 1000; ++k) haze.add_sample(1e-3, 0.01, 1, 0, 0, 1, 0);
    haze.end_ray();
    EXPECT_NEAR(forward(paper, haze).removed[0], 1 - (1 - std::exp(-0.01)) / 0.01, 1e-5);
    EXPECT_NEAR(forward(visible, haze).removed[0], 1.0, 1e-12);
}

TEST(Blend, EmptySpaceRemovesNothing) {
    for (const bool visible : {false, true}) {
        const BlendMode mode{false, true, false, false, visible};
        Rays<float> rays;
        for (int k = 0; k < 3; ++k) rays.add_sample(1, 0, 1, 0, 0, 0.5f, 0);
        rays.end_ray();
        rays.end_ray();  // and a ray without samples
        const auto out = forward(mode, rays);
        RayValues<float> grads(2, 1.0f);
        EXPECT_EQ(out.removed, (std::vector<float>{0, 0}));
        EXPECT_EQ(out.transmittance, (std::vector<float>{1, 1}));
        EXPECT_EQ(backward(mode, rays, grads)[2], (std::vector<float>{0, 0, 0}));
    }
}

// Σ weights + what passes through = 1 under `conserving`; `paper` exceeds it where both media are dense.
TEST(Blend, ConservingWeightsSumToOne) {
    Rays<double> rays = random_rays(4);
    rays.color_o.assign(rays.color_o.size(), 1.0);
    rays.color_e.assign(rays.color_e.size(), 1.0);
    for (BlendMode mode : all_modes()) {
        const auto out = forward(mode, rays);
        for (std::int64_t r = 0; r < rays.rays(); ++r) {
            const double total = out.color[3 * r] + out.transmittance[r];
            if (mode.conserving || !mode.add) {
                EXPECT_NEAR(total, 1.0, 1e-13) << name_of(mode);
            } else {
                EXPECT_GE(total, 1.0 - 1e-13) << name_of(mode);
            }
        }
    }
    Rays<double> opaque;
    opaque.add_sample(1, 1e4, 1, 1e4, 1, 0, 0);
    opaque.end_ray();
    EXPECT_DOUBLE_EQ(forward({true, false, false, false, false}, opaque).color[0], 2.0);
    EXPECT_DOUBLE_EQ(forward({true, false, false, true, false}, opaque).color[0], 1.0);
}

TEST(Blend, ChangeAloneKeepsTheTransmittanceExactly) {
    const Rays<double> rays = random_rays(6);
    const auto out = forward({false, false, true, false, false}, rays);
    for (std::int64_t r = 0; r < rays.rays(); ++r) {
        double depth = 0;
        for (std::int64_t k = rays.start[r]; k < rays.start[r + 1]; ++k) depth += rays.density_o[k] * rays.delta[k];
        EXPECT_EQ(out.transmittance[r], std::exp(-depth));
    }
}

std::string fmt_case(const BlendMode& mode, int samples, double depth_o, double depth_e, double beta) {
    std::ostringstream text;
    text << name_of(mode) << " K=" << samples << " depth_o=" << depth_o << " depth_e=" << depth_e << " beta=" << beta;
    return text.str();
}

Rays<float> hard_ray(double depth_o, double depth_e, double beta, int samples) {
    Rays<float> rays;
    for (int k = 0; k < samples; ++k) {
        rays.add_sample(1, static_cast<float>(depth_o), 0.75f, static_cast<float>(depth_e), 0.5f,
                        static_cast<float>(beta), static_cast<float>(beta));
    }
    rays.end_ray();
    return rays;
}

long double clamped(float depth) {
    return std::min<long double>(depth, 1e30L);
}

void check_hard_forward(const BlendMode& mode, const Rays<float>& rays, const BlendMath<float>& math) {
    const auto out = forward(mode, rays, math);
    const auto expected = oracle::blend(mode, oracle_ray(rays, 0, 0));
    const auto near = [](float actual, long double right, long double tolerance) {
        return std::isfinite(actual) && std::fabs(actual - right) <= tolerance + 2e-38L;
    };
    const long double tolerance = 1e-6L * expected.weight_bound;
    // exp(−A): the depth's own rounding (2⁻²³ relative) is a relative error of T in proportion to A.
    long double depth = 0;
    for (std::size_t k = 0; k < rays.delta.size(); ++k)
        depth += clamped(rays.density_o[k]) + clamped(rays.density_e[k]);
    ASSERT_TRUE(near(out.transmittance[0], expected.transmittance.value,
                     std::min(1.0L, 1e-6L * (1 + depth)) * expected.transmittance.value + 2e-38L));
    ASSERT_TRUE(near(out.color[0], expected.color.value, tolerance))
        << out.color[0] << " " << double(expected.color.value);
    ASSERT_TRUE(near(out.color_edit[0], expected.color_edit.value, tolerance));
    ASSERT_TRUE(near(out.alpha_edit[0], expected.alpha_edit.value, tolerance));
    ASSERT_TRUE(near(out.added[0], expected.added.value, tolerance));
    ASSERT_TRUE(near(out.changed[0], expected.changed.value, tolerance));
    ASSERT_TRUE(near(out.removed[0], expected.removed.value, 1e-6L * (expected.removed_bound + expected.removed.value)))
        << out.removed[0] << " " << double(expected.removed.value);
}

// Gradients of color + color_edit + alpha_edit + transmittance + the maps, at the first, a middle and the last sample.
void check_hard_backward(const BlendMode& mode, Rays<float> rays, bool against_oracle, const BlendMath<float>& math) {
    RayValues<float> ones(1, 0.0f);
    ones.color[0] = ones.color_edit[0] = ones.alpha_edit[0] = ones.transmittance[0] = 1;
    const auto grads = backward(mode, rays, ones, math);
    const auto map_grads = backward(mode, rays, RayValues<float>(1, 1.0f), math);
    for (const auto* all : {&grads, &map_grads}) {
        for (const auto& head : *all) {
            for (const float g : head) ASSERT_TRUE(std::isfinite(g));
        }
    }
    const std::size_t n = rays.delta.size();
    for (const std::size_t k : {std::size_t{0}, n / 2, n - 1}) {
        for (int head = 0; head < 4 && against_oracle; ++head) {
            auto ray = oracle_ray(rays, 0, 0);
            auto& values = head == 0   ? ray.density_e
                           : head == 1 ? ray.color_e
                           : head == 2 ? ray.beta_density
                                       : ray.beta_color;
            values[k].slope = 1;
            const auto expected = oracle::blend(mode, ray);
            const long double right = expected.color.slope + expected.color_edit.slope + expected.alpha_edit.slope +
                                      expected.transmittance.slope;
            // beta_density's is depth_o times (light of this sample − light behind it): that difference has their
            // rounding.
            const long double depth = clamped(rays.density_o[k]),
                              kept = depth * (1 - (long double)rays.beta_density[k]);
            const long double both = kept + clamped(rays.density_e[k]), front = both > 0 ? expl(-both * k) : 1;
            const long double light = front * std::max(both > 0 ? -expm1l(-both) / both : 1, expl(-kept));
            const long double scale = head == 2 ? depth * (light + 2e-33L) : 1;  // weights below 1e-38 are lost
            ASSERT_NEAR(grads[head][head == 1 ? 3 * k : k], right, 1e-5L * (std::fabs(right) + scale) + 1e-37L)
                << "head " << head << " sample " << k;
        }
    }
}

void check_hard_inputs(const BlendMath<float>& math) {
    for (const BlendMode& mode : {BlendMode{true, true, true, false, false}, BlendMode{true, true, true, true, true}}) {
        for (const int samples : {1, 2, 64, 4096}) {
            for (const double depth_o : hard_depths()) {
                for (const double depth_e : samples < 4096 ? hard_depths() : std::vector<double>{0, 1e-7, 1, 1e30}) {
                    for (const double beta : hard_betas) {
                        SCOPED_TRACE(fmt_case(mode, samples, depth_o, depth_e, beta));
                        const Rays<float> rays = hard_ray(depth_o, depth_e, beta, samples);
                        check_hard_forward(mode, rays, math);
                        check_hard_backward(mode, rays, samples <= 64, math);
                        if (::testing::Test::HasFatalFailure()) return;
                    }
                }
            }
        }
    }
}

void check_thin_media(const BlendMath<float>& math) {
    const BlendMode mode{false, true, false, false, false};
    Rays<float> rays;  // a little removed from a thin haze: 1 − exp(−a) and Tᵒ' − Tᵒ would both be 0 in float32
    for (int k = 0; k < 2; ++k) rays.add_sample(1, 1e-9f, 1, 0, 0, 1e-7f, 0);
    rays.end_ray();
    const auto out = forward(mode, rays, math);
    EXPECT_NEAR(out.color[0] / 2e-9, 1.0, 1e-5);
    EXPECT_NEAR(out.removed[0] / 0.5e-16, 1.0, 1e-5);
}

void check_nan(const BlendMath<float>& math) {
    Rays<float> rays = hard_ray(1, 1, 0.5, 2);
    rays.density_e[1] = std::numeric_limits<float>::quiet_NaN();
    EXPECT_TRUE(std::isnan(forward({true, false, false, false, false}, rays, math).color[0]));
}

TEST(Blend, HardInputsAgainstOracle) {
    check_hard_inputs(library_math<float>());
}

TEST(Blend, ThinMediaKeepTheirDigits) {
    check_thin_media(library_math<float>());
}

TEST(Blend, NanIsNotHidden) {
    check_nan(library_math<float>());
}

TEST(Blend, VectorsOfExponentialsKeepTheSamePromises) {
    const BlendMath<float> math{exp_negative, one_minus_exp_negative};
    fieldgraft::testing::on_every_target([&] {
        check_hard_inputs(math);
        check_thin_media(math);
        check_nan(math);
    });
}

TEST(Phi, AgainstLongDouble) {
    for (double x = 1e-12; x < 1e3; x *= 1.7) {
        const long double v = x, alpha = -expm1l(-v);
        EXPECT_NEAR(phi(x) / static_cast<double>(alpha / v), 1.0, 1e-15);
        if (x > 1e-4) {
            const double slope = static_cast<double>((expl(-v) - alpha / v) / v);
            EXPECT_NEAR(phi_derivative(x) / slope, 1.0, x < 0.01 ? 1e-11 : 1e-13) << x;
            EXPECT_NEAR(phi_derivative(static_cast<float>(x)) / slope, 1.0, 2e-6) << x;
        }
    }
    EXPECT_EQ(phi(0.0), 1.0);
    EXPECT_EQ(phi_derivative(0.0), -0.5);
    EXPECT_TRUE(std::isfinite(phi_derivative(2e30f)));
}

}  // namespace
}  // namespace fieldgraft
