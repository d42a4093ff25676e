#include "core/base/random.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <stdexcept>

#include "core/base/sha256.h"

namespace fieldgraft {
namespace {

// The published check of the generator's author: pcg32 seeded with 42, stream 54.
TEST(Random, MatchesThePublishedSequence) {
    Random random(42, 54);
    constexpr std::array<std::uint32_t, 6> expected = {0xa15c02b7, 0x7b47f409, 0xba1d3330,
                                                       0x83d2f293, 0xbfa4784b, 0xcbed606e};
    for (const std::uint32_t value : expected) EXPECT_EQ(random.bits(), value);
}

TEST(Random, StateRestoresAndStreamsDiffer) {
    Random a(7, 1), b(7, 2);
    a.bits();
    const auto state = a.state(), increment = a.increment();
    const std::uint32_t next = a.bits();
    EXPECT_NE(next, b.bits());
    b.restore(state, increment);
    EXPECT_EQ(b.bits(), next);
}

TEST(Random, UniformAndNormalHaveTheirMoments) {
    Random random(1);
    double sum = 0, square = 0, normal = 0, normal2 = 0, normal4 = 0;
    constexpr int count = 200000;
    for (int i = 0; i < count; ++i) {
        const double u = random.uniform();
        ASSERT_GE(u, 0.0);
        ASSERT_LT(u, 1.0);
        sum += u;
        square += u * u;
        const double n = random.normal();
        ASSERT_TRUE(std::isfinite(n));
        normal += n;
        normal2 += n * n;
        normal4 += n * n * n * n;
    }
    // Five standard errors each.
    EXPECT_NEAR(sum / count, 0.5, 5 * 0.289 / std::sqrt(count));
    EXPECT_NEAR(square / count, 1.0 / 3, 5 * 0.298 / std::sqrt(count));
    EXPECT_NEAR(normal / count, 0.0, 5 / std::sqrt(count));
    EXPECT_NEAR(normal2 / count, 1.0, 5 * 1.414 / std::sqrt(count));
    EXPECT_NEAR(normal4 / count, 3.0, 5 * 9.8 / std::sqrt(count));
}

TEST(Random, BelowIsUniform) {
    Random random(3);
    std::array<int, 7> counts{};
    constexpr int count = 70000;
    for (int i = 0; i < count; ++i) ++counts.at(random.below(7));
    double chi2 = 0;
    for (const int n : counts) chi2 += (n - 10000.0) * (n - 10000.0) / 10000.0;
    EXPECT_LT(chi2, 27.9);  // 6 degrees of freedom, p = 1e-4
    EXPECT_EQ(random.below(1), 0u);
    EXPECT_THROW(random.below(0), std::invalid_argument);
}

// FIPS 180-4's examples, and the million a's.
TEST(Sha256, MatchesTheStandardsExamples) {
    const auto hash = [](std::string_view text) {
        Sha256 sha;
        sha.update(text);
        return sha.hex();
    };
    EXPECT_EQ(hash(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
    EXPECT_EQ(hash("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    EXPECT_EQ(hash("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
              "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
    Sha256 pieces;
    const std::string some(997, 'a');
    for (int i = 0; i < 1003; ++i) pieces.update(some);
    EXPECT_EQ(pieces.hex(), hash(std::string(997 * 1003, 'a')));
    EXPECT_EQ(hash(std::string(1000000, 'a')), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

}  // namespace
}  // namespace fieldgraft
