#include "core/kernels/hash_grid_simd.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/kernels/numeric.h"
#include "tests/kernels/simd_targets.h"

namespace fieldgraft {
namespace {

using testing::on_every_target;
using testing::random_values;

struct Case {
    int levels, features, log2_table_size, base, finest;
    std::size_t samples, row;
};

class HashGridSimd : public ::testing::TestWithParam<Case> {
  protected:
    HashGrid grid() const {
        const Case& c = GetParam();
        return make_hash_grid(c.levels, c.features, c.log2_table_size, c.base, c.finest);
    }
    // Points along short rays, so that some share a cell; every seventh lies outside or on the cube's faces.
    std::vector<float> positions() const {
        const std::size_t n = GetParam().samples;
        auto values = random_values<float>(3 * n, 11, 0, 1);
        for (std::size_t s = 0; s < n; ++s) {
            for (std::size_t a = 0; a < 3; ++a) {
                float& x = values[a * n + s];
                if (s % 4 != 0) x = values[a * n + s - 1] + 0.0007f * static_cast<float>(a + 1);
                if (s % 7 == 3 && a == s % 3) x = s % 2 == 0 ? 1.0f : -0.25f;
                if (s % 7 == 5 && a == s % 3) x = s % 2 == 0 ? 0.0f : 1.75f;
            }
        }
        return values;
    }
};

TEST_P(HashGridSimd, ForwardEqualsTheReference) {
    const HashGrid grid = this->grid();
    const auto [n, row] = std::pair(GetParam().samples, GetParam().row);
    const auto table = random_values<float>(grid.entries * grid.features, 1);
    const auto at = positions();
    std::vector<float> expected(grid.rows() * n);
    hash_grid_forward<float>(grid, table, at, expected);
    on_every_target([&] {
        std::vector<float> rows(n * row + 1, NAN);
        rows[n * row] = 77;
        hash_grid_encode(grid, table, at.data(), n, rows.data(), row);
        EXPECT_EQ(rows[n * row], 77) << "wrote past the end";
        double worst = 0;
        for (std::size_t s = 0; s < n; ++s) {
            for (std::size_t i = 0; i < row; ++i) {
                const double want = i < grid.rows() ? expected[i * n + s] : 0, found = rows[s * row + i];
                worst = std::isnan(found) ? std::numeric_limits<double>::infinity()
                                          : std::max(worst, std::abs(found - want));
            }
        }
        EXPECT_LT(worst, 2e-6);
    });
}

TEST_P(HashGridSimd, BackwardEqualsTheReference) {
    const HashGrid grid = this->grid();
    const auto [n, row] = std::pair(GetParam().samples, GetParam().row);
    const auto at = positions();
    const auto rows = random_values<float>(n * row, 2);
    std::vector<double> columns(grid.rows() * n), table(grid.entries * grid.features), wide_at(at.begin(), at.end());
    for (std::size_t s = 0; s < n; ++s) {
        for (std::size_t i = 0; i < grid.rows(); ++i) columns[i * n + s] = rows[s * row + i];
    }
    // In double, but of the cells and weights that float positions have.
    std::vector<float> narrow_columns(columns.begin(), columns.end()), expected(table.size());
    const HashGridChunk<float> chunk{at, narrow_columns};
    hash_grid_backward<float>(grid, {&chunk, 1}, expected, serial_for);
    const std::size_t split = n / 3;
    std::vector<float> first(3 * split), second(3 * (n - split));
    for (std::size_t a = 0; a < 3; ++a) {
        std::copy_n(at.data() + a * n, split, first.data() + a * split);
        std::copy_n(at.data() + a * n + split, n - split, second.data() + a * (n - split));
    }
    // The second part level after level.
    const std::size_t features = static_cast<std::size_t>(grid.features);
    std::vector<float> rest((n - split) * grid.rows());
    for (std::size_t s = split; s < n; ++s) {
        for (std::size_t i = 0; i < grid.rows(); ++i) {
            rest[(i / features * (n - split) + s - split) * features + i % features] = rows[s * row + i];
        }
    }
    on_every_target([&] {
        const std::vector<HashGridRows> parts{
            {first.data(), rows.data(), split, row, features},
            {second.data(), rest.data(), n - split, features, (n - split) * features}};
        std::vector<float> grad(expected.size(), 0.0f);
        for (std::size_t l = 0; l < grid.levels.size(); ++l) {
            hash_grid_add_gradient(grid, static_cast<int>(l), parts,
                                   grad.data() + grid.levels[l].offset * grid.features);
        }
        double worst = 0;
        for (std::size_t i = 0; i < grad.size(); ++i) {
            worst = std::isnan(grad[i]) ? std::numeric_limits<double>::infinity()
                                        : std::max<double>(worst, std::abs(grad[i] - expected[i]));
        }
        EXPECT_LT(worst, 1e-5 * std::sqrt(static_cast<double>(n) + 1));
    });
}

INSTANTIATE_TEST_SUITE_P(Grids, HashGridSimd,
                         ::testing::Values(Case{16, 2, 17, 16, 1024, 515, 32}, Case{16, 2, 12, 16, 2048, 1000, 32},
                                           Case{3, 2, 19, 8, 32, 1, 16}, Case{1, 2, 14, 4, 4, 17, 16},
                                           Case{5, 2, 10, 2, 64, 0, 16}, Case{8, 2, 15, 16, 512, 9001, 16},
                                           Case{4, 4, 12, 8, 128, 2100, 16}, Case{3, 4, 17, 8, 32, 9001, 16},
                                           Case{3, 4, 17, 8, 32, 1, 12}, Case{3, 4, 10, 8, 32, 0, 16},
                                           Case{2, 3, 10, 8, 32, 33, 6}));

TEST(HashGridSimdHardInputs, NaNPositionsTouchNothingOutsideTheTable) {
    const float inf = std::numeric_limits<float>::infinity();
    const std::vector<float> at{NAN, inf, 0.5f, 0.5f, -inf, 0.5f, 1e30f, 0.25f, NAN};
    const std::vector<float> grads(3 * 16, 1.0f);
    for (const std::size_t features : {2, 4}) {
        const HashGrid grid = make_hash_grid(4, static_cast<int>(features), 10, 4, 64);
        const auto table = random_values<float>(grid.entries * features, 3);
        on_every_target([&] {
            std::vector<float> rows(3 * 16), grad(table.size());
            hash_grid_encode(grid, table, at.data(), 3, rows.data(), 16);
            EXPECT_TRUE(std::isfinite(rows[2 * 16]));
            const HashGridRows part{at.data(), grads.data(), 3, 16, features};
            for (int l = 0; l < 4; ++l)
                hash_grid_add_gradient(grid, l, {&part, 1}, grad.data() + features * grid.levels[l].offset);
        });
    }
}

TEST(HashGridSimdHardInputs, RefusesWrongSizes) {
    const HashGrid grid = make_hash_grid(4, 2, 10, 4, 64);
    const std::vector<float> table(grid.entries * 2), at(3), few(grid.entries);
    std::vector<float> row(8);
    EXPECT_THROW(hash_grid_encode(grid, few, at.data(), 1, row.data(), 8), std::invalid_argument);
    EXPECT_THROW(hash_grid_encode(grid, table, at.data(), 1, row.data(), 7), std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
