#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "core/kernels/exp_simd.h"
#include "tests/kernels/simd_targets.h"

namespace fieldgraft {
namespace {

// From denormal to infinite, in a number that no vector divides.
std::vector<float> inputs() {
    std::vector<float> x{0, 1e-45f, 1e-38f, std::numeric_limits<float>::infinity(), 1e30f, 103.9f, 104, 104.1f};
    for (float v = 1e-30f; v < 1e5f; v *= 1.13f) x.push_back(v);
    x.resize(x.size() / 16 * 16 + 5, 0.5f);
    return x;
}

TEST(ExpSimd, AgainstLongDouble) {
    const std::vector<float> x = inputs();
    testing::on_every_target([&] {
        std::vector<float> passed(x.size() + 1, 77), covered = passed;
        exp_negative(x.data(), x.size(), passed.data());
        one_minus_exp_negative(x.data(), x.size(), covered.data());
        for (std::size_t i = 0; i < x.size(); ++i) {
            const long double v = x[i], left = expl(-v), taken = -expm1l(-v);
            EXPECT_NEAR(passed[i], left, 3e-7L * left + 2e-38L) << x[i];
            EXPECT_NEAR(covered[i], taken, 5e-7L * taken + 1e-45L) << x[i];
        }
        EXPECT_EQ(passed.back(), 77);
        EXPECT_EQ(covered.back(), 77);
    });
}

TEST(ExpSimd, NanStaysAndInPlaceWorks) {
    testing::on_every_target([&] {
        std::vector<float> x{1, NAN, 2}, y = x;
        exp_negative(x.data(), 3, x.data());
        one_minus_exp_negative(y.data(), 3, y.data());
        EXPECT_TRUE(std::isnan(x[1]) && std::isnan(y[1]));
        EXPECT_NEAR(x[2] + y[2], 1, 1e-6);
    });
}

}  // namespace
}  // namespace fieldgraft
