#include "core/kernels/spherical_harmonics_ref.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace fieldgraft {
namespace {

// Y_l^m from associated Legendre functions (with the Condon–Shortley sign, as std::assoc_legendre has not).
double harmonic(int l, int m, double theta, double phi) {
    const int k = std::abs(m);
    double ratio = 1;
    for (int i = l - k + 1; i <= l + k; ++i) ratio /= i;
    const double norm = std::sqrt((2 * l + 1) / (4 * std::numbers::pi) * ratio);
    const double sign = k % 2 ? -1 : 1;
    const double p = sign * std::assoc_legendre(l, k, std::cos(theta));
    if (m == 0) return norm * p;
    return std::sqrt(2.0) * norm * p * (m > 0 ? std::cos(k * phi) : std::sin(k * phi));
}

TEST(SphericalHarmonics, AgreeWithLegendreFunctions) {
    for (double theta = 0.1; theta < 3.1; theta += 0.37) {
        for (double phi = -3; phi < 3; phi += 0.41) {
            const std::vector<double> d{std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi),
                                        std::cos(theta)};
            std::vector<double> out(16);
            spherical_harmonics<double>(4, d, out);
            for (int l = 0, i = 0; l < 4; ++l) {
                for (int m = -l; m <= l; ++m, ++i)
                    ASSERT_NEAR(out[i], harmonic(l, m, theta, phi), 1e-12) << l << ' ' << m;
            }
        }
    }
}

TEST(SphericalHarmonics, LowerDegreesAreThePrefixAndLayoutIsFeatureMajor) {
    const std::vector<float> directions{1, 0, 0, 1, 0, 0};  // x x | y y | z z: (1, 0, 0) and (0, 1, 0)
    std::vector<float> four(32), two(8);
    spherical_harmonics<float>(4, directions, four);
    spherical_harmonics<float>(2, directions, two);
    for (int i = 0; i < 8; ++i) EXPECT_EQ(two[i], four[i]);
    EXPECT_NE(four[2], four[3]);
    std::vector<float> none;
    EXPECT_NO_THROW(spherical_harmonics<float>(3, {}, none));
    EXPECT_THROW(spherical_harmonics<float>(5, directions, four), std::invalid_argument);
    EXPECT_THROW(spherical_harmonics<float>(3, directions, four), std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
