#include "core/kernels/hash_grid_ref.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "tests/kernels/numeric.h"

namespace fieldgraft {
namespace {

using testing::random_values;

// The encoding of one point straight from the definition: one vertex at a time, no groups, 64-bit hashing.
std::vector<double> naive(const HashGrid& grid, const std::vector<double>& table, const std::array<double, 3>& point) {
    std::vector<double> out;
    for (const auto& level : grid.levels) {
        std::array<std::uint64_t, 3> lower{};
        std::array<double, 3> fraction{};
        for (int c = 0; c < 3; ++c) {
            const double x = std::clamp(point[c], 0.0, 1.0) * level.resolution;
            lower[c] = static_cast<std::uint64_t>(std::min(std::floor(x), level.resolution - 1.0));
            fraction[c] = x - static_cast<double>(lower[c]);
        }
        std::vector<double> sum(grid.features, 0.0);
        for (int corner = 0; corner < 8; ++corner) {
            std::array<std::uint64_t, 3> v{};
            double weight = 1;
            for (int c = 0; c < 3; ++c) {
                const int up = (corner >> c) & 1;
                v[c] = lower[c] + up;
                weight *= up ? fraction[c] : 1 - fraction[c];
            }
            const std::uint64_t side = level.resolution + 1;
            const std::uint64_t hashed = v[0] ^ (v[1] * 2654435761ull) ^ (v[2] * 805459861ull);
            const std::uint64_t index = level.dense ? v[0] + side * (v[1] + side * v[2]) : hashed % level.entries;
            for (int f = 0; f < grid.features; ++f) {
                sum[f] += weight * table[(level.offset + index) * grid.features + f];
            }
        }
        out.insert(out.end(), sum.begin(), sum.end());
    }
    return out;
}

TEST(HashGrid, LevelsGrowGeometricallyAndAreDenseWhileTheyFit) {
    const HashGrid grid = make_hash_grid(16, 2, 17, 16, 1024);
    ASSERT_EQ(grid.levels.size(), 16u);
    EXPECT_EQ(grid.levels.front().resolution, 16);
    EXPECT_EQ(grid.levels.back().resolution, 1024);
    EXPECT_TRUE(grid.levels.front().dense);
    EXPECT_EQ(grid.levels.front().entries, 17u * 17 * 17);
    EXPECT_FALSE(grid.levels.back().dense);
    EXPECT_EQ(grid.levels.back().entries, 1u << 17);
    std::size_t total = 0;
    for (const auto& level : grid.levels) {
        EXPECT_EQ(level.offset, total);
        total += level.entries;
    }
    EXPECT_EQ(grid.entries, total);
}

TEST(HashGrid, AgreesWithTheDefinitionForAllFeatureCountsAndOddSizes) {
    for (int features = 1; features <= 8; ++features) {
        const HashGrid grid = make_hash_grid(5, features, 9, 3, 61);
        ASSERT_TRUE(grid.levels.front().dense);
        ASSERT_FALSE(grid.levels.back().dense);
        const auto table = random_values<double>(grid.entries * features, 1);
        for (const std::size_t n : {0u, 1u, 31u, 32u, 33u, 70u}) {
            const auto positions = random_values<double>(3 * n, 2 + n, -0.1, 1.1);
            std::vector<double> encoded(grid.rows() * n, 99.0);
            hash_grid_forward<double>(grid, table, positions, encoded);
            for (std::size_t i = 0; i < n; ++i) {
                const auto expected = naive(grid, table, {positions[i], positions[n + i], positions[2 * n + i]});
                for (std::size_t k = 0; k < grid.rows(); ++k) ASSERT_NEAR(encoded[k * n + i], expected[k], 1e-12);
            }
        }
    }
}

TEST(HashGrid, AVertexHasItsOwnEntryAndTheFarCornerIsInside) {
    const HashGrid grid = make_hash_grid(1, 1, 10, 4, 4);
    auto table = random_values<double>(grid.entries, 7);
    const std::vector<double> corner{1, 1, 1}, vertex{0.25, 0.5, 0.75};
    std::vector<double> out(1);
    hash_grid_forward<double>(grid, table, corner, out);
    EXPECT_DOUBLE_EQ(out[0], table.back());
    hash_grid_forward<double>(grid, table, vertex, out);
    EXPECT_DOUBLE_EQ(out[0], table[1 + 5 * (2 + 5 * 3)]);
}

TEST(HashGrid, NotANumberReadsInsideTheTable) {
    const HashGrid grid = make_hash_grid(4, 2, 8, 2, 64);
    const std::vector<float> table(grid.entries * 2, 0.5f);
    const std::vector<float> positions{NAN, INFINITY, -INFINITY};
    std::vector<float> out(grid.rows());
    hash_grid_forward<float>(grid, table, positions, out);
    for (const float value : out) EXPECT_FLOAT_EQ(value, 0.5f);  // weights of some cell of the cube, which sum to 1
}

TEST(HashGrid, BackwardIsTheTransposeOfForward) {
    // Forward is linear in the table: ⟨G, F(table)⟩ = ⟨Fᵀ(G), table⟩ for all tables is the whole gradient.
    for (const int features : {1, 2, 4}) {
        const HashGrid grid = make_hash_grid(4, features, 8, 2, 40);
        const std::size_t n = 77;
        const auto positions = random_values<double>(3 * n, 3, 0, 1);
        const auto grad = random_values<double>(grid.rows() * n, 4);
        std::vector<double> table_grad(grid.entries * features, 0.0);
        const std::vector<HashGridChunk<double>> chunks{{positions, grad}};
        hash_grid_backward<double>(grid, chunks, table_grad, serial_for);
        for (unsigned trial = 0; trial < 5; ++trial) {
            const auto table = random_values<double>(grid.entries * features, 10 + trial);
            std::vector<double> encoded(grid.rows() * n);
            hash_grid_forward<double>(grid, table, positions, encoded);
            EXPECT_NEAR(testing::dot(encoded, grad), testing::dot(table_grad, table), 1e-10);
        }
    }
}

TEST(HashGrid, BackwardAddsAndDoesNotDependOnTheSplit) {
    const HashGrid grid = make_hash_grid(6, 2, 8, 2, 40);
    const auto a = random_values<float>(3 * 50, 1, 0, 1), b = random_values<float>(3 * 13, 2, 0, 1);
    const auto ga = random_values<float>(grid.rows() * 50, 3), gb = random_values<float>(grid.rows() * 13, 4);
    const std::vector<HashGridChunk<float>> chunks{{a, ga}, {b, gb}};
    std::vector<float> one(grid.entries * 2, 1.0f), other = one, twice(grid.entries * 2, 0.0f);
    hash_grid_backward<float>(grid, chunks, one, serial_for);
    hash_grid_backward<float>(grid, chunks, other, testing::backwards_for);
    EXPECT_EQ(one, other);
    hash_grid_backward<float>(grid, chunks, twice, serial_for);
    for (std::size_t i = 0; i < twice.size(); ++i) ASSERT_NEAR(one[i], 1.0f + twice[i], 1e-5f);
}

TEST(HashGrid, RefusesWhatMakesNoSense) {
    EXPECT_THROW(make_hash_grid(0, 2, 10, 4, 8), std::invalid_argument);
    EXPECT_THROW(make_hash_grid(2, 9, 10, 4, 8), std::invalid_argument);
    EXPECT_THROW(make_hash_grid(2, 2, 29, 4, 8), std::invalid_argument);
    EXPECT_THROW(make_hash_grid(2, 2, 10, 9, 8), std::invalid_argument);
    const HashGrid grid = make_hash_grid(2, 2, 10, 4, 8);
    const std::vector<float> table(grid.entries * 2), positions(6);
    std::vector<float> wrong(grid.rows() * 2 + 1);
    EXPECT_THROW(hash_grid_forward<float>(grid, table, positions, wrong), std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
