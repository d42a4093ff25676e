// Where a derivative does not exist: what the kernels take is one of the one-sided derivatives (docs/stability.md).
#include <gtest/gtest.h>

#include "core/kernels/composite_ref.h"
#include "core/kernels/mlp_ref.h"
#include "tests/stability/hard_rays.h"

namespace fieldgraft::stability {
namespace {

// y = w₁ max(0, w₀ x) at x = 0: its derivatives are w₀ w₁ from above and 0 from below.
TEST(Kinks, ReluAtZeroTakesTheLowerSide) {
    const std::vector<double> w0{3}, w1{2}, one{1};
    for (const auto& [x, slope] : {std::pair{0.0, 0.0}, {-0.0, 0.0}, {1e-300, 6.0}, {-1e-300, 0.0}}) {
        const std::vector<double> input{x};
        std::vector<std::vector<double>> layers;
        std::vector<double> grad0(1), grad1(1), input_grad(1);
        mlp_forward<double>({{1, 1, 1}}, {w0, w1}, input, layers);
        mlp_backward<double>({{1, 1, 1}}, {w0, w1}, input, layers, one, {grad0, grad1}, input_grad);
        EXPECT_EQ(input_grad[0], slope) << x;
    }
}

// A depth at its clamp is opaque: from above the derivative is 0, and from below it is too, to all digits.
TEST(Kinks, ClampedDepthsHaveNoGradient) {
    for (const float density : {1e29f, 1e30f, 3e30f, std::numeric_limits<float>::infinity()}) {
        const Rays<float> rays = uniform_ray(density, density, 0.5f, 2);
        RayValues<float> ones(1, 1.0f);
        for (const bool conserving : {false, true}) {
            const auto grads = backward({true, false, false, conserving, false}, rays, ones);
            for (const float g : grads[0]) EXPECT_NEAR(g, 0, 1e-28) << density;
        }
        const std::vector<float> t{1, 2}, one{1}, white{1, 1, 1};
        std::vector<float> density_grad(2), color_grad(6);
        composite_backward<float>({rays.start, rays.delta, t, rays.density_o, rays.color_o}, white, one, density_grad,
                                  color_grad, serial_for);
        for (const float g : density_grad) EXPECT_EQ(g, 0) << density;
    }
}

}  // namespace
}  // namespace fieldgraft::stability
