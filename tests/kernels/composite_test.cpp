#include "core/kernels/composite_ref.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/kernels/numeric.h"

namespace fieldgraft {
namespace {

using testing::random_values;

template <class T>
struct Rays {
    std::vector<std::int64_t> start;
    std::vector<T> delta, t, density, color;

    CompositeInput<T> input() const { return {start, delta, t, density, color}; }
    std::size_t count() const { return start.size() - 1; }
};

template <class T>
struct Out {
    std::vector<T> color, transmittance, depth;
};

template <class T>
Out<T> forward(const Rays<T>& rays, const ParallelFor& parallel_for = serial_for) {
    Out<T> out{std::vector<T>(3 * rays.count()), std::vector<T>(rays.count()), std::vector<T>(rays.count())};
    composite_forward<T>(rays.input(), out.color, out.transmittance, out.depth, parallel_for);
    return out;
}

// One ray of K samples whose optical depths (δ = 1) are given.
template <class T>
Rays<T> one_ray(const std::vector<double>& depths) {
    const std::size_t n = depths.size();
    Rays<T> rays{{0, static_cast<std::int64_t>(n)}, std::vector<T>(n, 1), {}, {}, random_values<T>(3 * n, 5, 0, 1)};
    for (std::size_t k = 0; k < n; ++k) {
        rays.t.push_back(static_cast<T>(k + 0.5));
        rays.density.push_back(static_cast<T>(depths[k]));
    }
    return rays;
}

TEST(Composite, ConstantDensityIsTheClosedForm) {
    for (const double sigma : {1e-9, 1e-3, 1.0, 30.0}) {
        for (const int k : {1, 2, 64, 4096}) {
            const double length = 2.0;
            Rays<double> rays{{0, k},
                              std::vector<double>(k, length / k),
                              std::vector<double>(k, 1.0),
                              std::vector<double>(k, sigma),
                              std::vector<double>(3 * k, 0.5)};
            const auto out = forward(rays);
            EXPECT_NEAR(out.color[0], -0.5 * std::expm1(-sigma * length), 1e-12);
            EXPECT_NEAR(out.transmittance[0], std::exp(-sigma * length), 1e-12);
        }
    }
}

TEST(Composite, SplittingAnIntervalChangesNothing) {
    auto whole = one_ray<double>({0.3, 0.0, 2.5, 0.7});
    Rays<double> split;
    split.start = {0, 8};
    for (std::size_t k = 0; k < 4; ++k) {
        for (const double part : {0.25, 0.75}) {
            split.delta.push_back(part * whole.delta[k]);
            split.t.push_back(whole.t[k]);
            split.density.push_back(whole.density[k]);
            for (int c = 0; c < 3; ++c) split.color.push_back(whole.color[3 * k + c]);
        }
    }
    const auto a = forward(whole), b = forward(split);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(a.color[c], b.color[c], 1e-14);
    EXPECT_NEAR(a.transmittance[0], b.transmittance[0], 1e-14);
    EXPECT_NEAR(a.depth[0], b.depth[0], 1e-14);
}

TEST(Composite, WeightsAndWhatPassesThroughSumToOne) {
    auto rays = one_ray<float>({0.1, 3.0, 1e-8, 20.0, 0.4, 1e30});
    std::fill(rays.color.begin(), rays.color.end(), 1.0f);
    const auto out = forward(rays);
    EXPECT_NEAR(out.color[0] + out.transmittance[0], 1.0f, 1e-6f);
}

TEST(Composite, EmptyAndOpaqueLimits) {
    Rays<float> none{{0}, {}, {}, {}, {}};
    EXPECT_TRUE(forward(none).color.empty());
    Rays<float> gaps = one_ray<float>({0.5, 1.0});
    gaps.start = {0, 0, 2, 2};
    const auto out = forward(gaps);
    EXPECT_EQ(out.transmittance[0], 1.0f);
    EXPECT_EQ(out.color[0], 0.0f);
    EXPECT_EQ(out.depth[0], 0.0f);
    EXPECT_LT(out.transmittance[1], 1.0f);
    EXPECT_EQ(out.transmittance[2], 1.0f);
    const auto opaque = one_ray<float>({INFINITY, 1.0});
    const auto wall = forward(opaque);
    for (int c = 0; c < 3; ++c) EXPECT_EQ(wall.color[c], opaque.color[c]);
    EXPECT_EQ(wall.transmittance[0], 0.0f);
    EXPECT_EQ(wall.depth[0], 0.5f);
}

TEST(Composite, HardInputsAgreeWithLongDouble) {
    for (const double a : {0.0, 1e-38, 1e-12, 1e-7, 1e-3, 1.0, 20.0, 100.0, 1e4, 1e30, double(INFINITY)}) {
        for (const int k : {1, 2, 64, 4096}) {
            const auto rays = one_ray<float>(std::vector<double>(k, a));
            const auto out = forward(rays);
            long double total = 0, sum = 0, weights = 0;
            for (int i = 0; i < k; ++i) {
                const long double depth = std::min<long double>(static_cast<float>(a), 1e30L);
                const long double w = std::exp(-total) * -std::expm1(-depth);
                sum += w * rays.color[3 * i];
                weights += w;
                total += depth;
            }
            const double bound =
                1e-6 * (1 + std::min(static_cast<double>(total), 100.0)) * static_cast<double>(weights);
            ASSERT_NEAR(out.color[0], static_cast<double>(sum), bound + 1.2e-38) << a << " x " << k;
            const double passed = static_cast<double>(std::exp(-total));
            ASSERT_NEAR(out.transmittance[0], passed, 1e-6 * (1 + static_cast<double>(total)) * passed + 1.2e-38);
            std::vector<float> density_grad(k), color_grad(3 * k);
            composite_backward<float>(rays.input(), std::vector<float>{1, 1, 1}, std::vector<float>{1}, density_grad,
                                      color_grad, serial_for);
            for (const float g : density_grad) ASSERT_TRUE(std::isfinite(g)) << a << " x " << k;
            for (const float g : color_grad) ASSERT_TRUE(std::isfinite(g)) << a << " x " << k;
        }
    }
}

Rays<double> several_rays() {
    Rays<double> rays;
    rays.start = {0, 1, 1, 4, 11};
    rays.density = random_values<double>(11, 1, 0, 3);
    rays.delta = random_values<double>(11, 2, 0.1, 0.6);
    rays.t = random_values<double>(11, 3, 1, 2);
    rays.color = random_values<double>(33, 4, 0, 1);
    return rays;
}

TEST(Composite, BackwardEqualsFiniteDifferences) {
    auto rays = several_rays();
    rays.density[5] = 0;
    rays.density[7] = 60;  // opaque: what is behind must get next to nothing, exactly
    const auto color_out_grad = random_values<double>(12, 5), transmittance_grad = random_values<double>(4, 6);
    std::vector<double> density_grad(11), color_grad(33);
    composite_backward<double>(rays.input(), color_out_grad, transmittance_grad, density_grad, color_grad, serial_for);
    const auto loss = [&] {
        const auto out = forward(rays);
        return testing::dot(out.color, color_out_grad) + testing::dot(out.transmittance, transmittance_grad);
    };
    for (int k = 0; k < 11; ++k) {
        ASSERT_NEAR(density_grad[k], testing::slope(rays.density[k], 1e-6, loss), 1e-8) << k;
    }
    for (int k = 0; k < 33; ++k) ASSERT_NEAR(color_grad[k], testing::slope(rays.color[k], 1e-6, loss), 1e-8) << k;
}

TEST(Composite, ThinMediaKeepTheirGradient) {
    // d color / d σ of one thin sample is δ·c to first order; 1 − exp(−a) in float would lose it below a = 1e-7.
    const auto rays = one_ray<float>({1e-20});
    std::vector<float> density_grad(1), color_grad(3);
    composite_backward<float>(rays.input(), std::vector<float>{1, 0, 0}, std::vector<float>{0}, density_grad,
                              color_grad, serial_for);
    EXPECT_FLOAT_EQ(density_grad[0], rays.color[0]);
    EXPECT_FLOAT_EQ(color_grad[0], 1e-20f);
}

TEST(Composite, TheSplitDoesNotMatter) {
    Rays<float> rays;
    rays.start = {0};
    for (int r = 0; r < 300; ++r) rays.start.push_back(rays.start.back() + r % 7);
    const std::size_t n = rays.start.back();
    rays.density = random_values<float>(n, 1, 0, 5);
    rays.delta = random_values<float>(n, 2, 0, 1);
    rays.t = random_values<float>(n, 3, 0, 1);
    rays.color = random_values<float>(3 * n, 4, 0, 1);
    EXPECT_EQ(forward(rays).color, forward(rays, testing::backwards_for).color);
}

TEST(Composite, RefusesSizesThatDoNotMatch) {
    auto rays = several_rays();
    rays.start.back() = 12;
    EXPECT_THROW(forward(rays), std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
