#include "core/kernels/adam_ref.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/kernels/adam_simd.h"
#include "tests/kernels/numeric.h"
#include "tests/kernels/simd_targets.h"

namespace fieldgraft {
namespace {

using testing::random_values;

TEST(Adam, ThreeStepsByTheFormula) {
    const std::size_t n = 37;
    auto p = random_values<double>(n, 1);
    std::vector<double> m(n, 0), v(n, 0);
    auto expected = p;
    std::vector<double> em(n, 0), ev(n, 0);
    for (int t = 1; t <= 3; ++t) {
        const auto g = random_values<double>(n, 10 + t);
        AdamStep step;
        step.t = t;
        step.epsilon = 1e-8;
        adam_step<double>(step, g, p, m, v, testing::backwards_for);
        for (std::size_t i = 0; i < n; ++i) {
            em[i] = 0.9 * em[i] + 0.1 * g[i];
            ev[i] = 0.99 * ev[i] + 0.01 * g[i] * g[i];
            expected[i] -=
                1e-2 * (em[i] / (1 - std::pow(0.9, t))) / (std::sqrt(ev[i] / (1 - std::pow(0.99, t))) + 1e-8);
            ASSERT_NEAR(p[i], expected[i], 1e-14);
        }
    }
}

TEST(Adam, SkipsUntouchedEntriesOnlyWhenAsked) {
    const std::size_t n = 40;  // a whole run of zeros, and zeros among others
    std::vector<float> g(n, 0), p(n, 1), m(n, 0.5f), v(n, 0.25f);
    g[20] = 3;
    auto p2 = p, m2 = m, v2 = v;
    AdamStep step;
    step.skip_zero = true;
    adam_step<float>(step, g, p, m, v, serial_for);
    for (std::size_t i = 0; i < n; ++i) {
        EXPECT_EQ(p[i] == 1.0f, i != 20) << i;
        EXPECT_EQ(m[i] == 0.5f, i != 20) << i;
    }
    step.skip_zero = false;
    adam_step<float>(step, g, p2, m2, v2, serial_for);
    for (std::size_t i = 0; i < n; ++i) EXPECT_NE(p2[i], 1.0f) << i;
}

TEST(Adam, FindsWhatIsNotFinite) {
    std::vector<float> values(1000, 3e38f);
    EXPECT_TRUE(all_finite<float>(values, serial_for));
    for (const float bad : {NAN, INFINITY, -INFINITY}) {
        for (const std::size_t place : {0u, 500u, 999u}) {
            values[place] = bad;
            EXPECT_FALSE(all_finite<float>(values, serial_for));
            values[place] = 0;
        }
    }
    EXPECT_TRUE(all_finite<float>(std::span<const float>(), serial_for));
}

TEST(Adam, EveryTargetStepsAsTheReferenceDoes) {
    const std::size_t n = 1003;  // not a multiple of any vector
    std::vector<float> g = random_values<float>(n, 3);
    for (std::size_t i = 0; i < n; ++i) g[i] = i % 5 == 0 || (i > 200 && i < 300) ? 0.0f : g[i];
    for (const bool skip_zero : {true, false}) {
        testing::on_every_target([&] {
            auto p = random_values<float>(n, 4), m = random_values<float>(n, 5), v = random_values<float>(n, 6, 0, 1);
            auto p2 = p, m2 = m, v2 = v;
            AdamStep step;
            step.skip_zero = skip_zero;
            for (step.t = 1; step.t <= 4; ++step.t) {
                adam_step<float>(step, g, p, m, v, serial_for);
                adam_step_part(step, g, p2, m2, v2);
            }
            for (std::size_t i = 0; i < n; ++i) {
                ASSERT_NEAR(m2[i], m[i], 1e-6) << i;
                ASSERT_NEAR(v2[i], v[i], 1e-6) << i;
                ASSERT_NEAR(p2[i], p[i], 2e-6) << i;
                if (skip_zero && g[i] == 0) {
                    ASSERT_EQ(p2[i], p[i]) << i;
                }
            }
        });
    }
}

TEST(Adam, RefusesWhatMakesNoSense) {
    std::vector<float> g(3), p(4), m(4), v(4);
    EXPECT_THROW(adam_step<float>({}, g, p, m, v, serial_for), std::invalid_argument);
    EXPECT_THROW(adam_step_part({}, g, p, m, v), std::invalid_argument);
    AdamStep step;
    step.t = 0;
    g.resize(4);
    EXPECT_THROW(adam_step<float>(step, g, p, m, v, serial_for), std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
