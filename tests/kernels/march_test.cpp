#include "core/kernels/march_ref.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/kernels/numeric.h"

namespace fieldgraft {
namespace {

using testing::random_values;

struct Marched {
    std::vector<std::int64_t> start, ray;
    std::vector<float> positions, t;
};

Marched march(const MarchGrid& grid, const MarchRays& rays, const ParallelFor& parallel_for = serial_for) {
    const std::size_t count = rays.origins.size() / 3;
    std::vector<std::int64_t> counts(count);
    march_count(grid, rays, counts, parallel_for);
    Marched out;
    out.start.push_back(0);
    for (const auto c : counts) out.start.push_back(out.start.back() + c);
    const std::size_t n = out.start.back();
    out.ray.resize(n);
    out.positions.resize(3 * n);
    out.t.resize(n);
    march_fill(grid, rays, out.start, out.ray, out.positions, out.t, parallel_for);
    return out;
}

// The plain loop over k that the skipping must reproduce.
std::vector<float> plain(const MarchGrid& grid, const std::vector<std::uint8_t>& cells, const MarchRays& rays,
                         std::size_t r) {
    std::vector<float> out;
    const double jitter = rays.jitter.empty() ? 0 : rays.jitter[r];
    for (int k = 0; k < 20000; ++k) {
        const double t = rays.near + (k + 0.5 + jitter) * rays.step;
        bool inside = t >= rays.near;
        int cell[3] = {};
        for (int c = 0; c < 3; ++c) {
            const float x = static_cast<float>(rays.origins[3 * r + c] + t * rays.directions[3 * r + c]);
            inside = inside && x >= grid.box_min[c] && x <= grid.box_max[c];
            const double p = (x - grid.box_min[c]) / (grid.box_max[c] - grid.box_min[c]) * grid.resolution;
            cell[c] = std::clamp(static_cast<int>(p), 0, std::max(grid.resolution - 1, 0));
        }
        const std::size_t n = grid.resolution;
        if (inside && (n == 0 || cells[(cell[2] * n + cell[1]) * n + cell[0]] != 0)) {
            out.push_back(static_cast<float>(t));
        }
    }
    return out;
}

std::vector<float> unit_directions(std::size_t count, unsigned seed) {
    auto d = random_values<float>(3 * count, seed);
    for (std::size_t r = 0; r < count; ++r) {
        const float l = std::sqrt(d[3 * r] * d[3 * r] + d[3 * r + 1] * d[3 * r + 1] + d[3 * r + 2] * d[3 * r + 2]);
        for (int c = 0; c < 3; ++c) d[3 * r + c] /= l;
    }
    return d;
}

TEST(March, ARayThroughTheBoxHasTheSamplesOfItsLength) {
    const MarchGrid grid = make_march_grid({-1, -1, -1}, {1, 1, 1}, 0, {});
    const std::vector<float> origins{-3, 0, 0, 0, 5, 0}, directions{1, 0, 0, 1, 0, 0};
    const MarchRays rays{origins, directions, {}, 0.1, 0};
    const auto out = march(grid, rays);
    EXPECT_EQ(out.start[1], 20);
    EXPECT_EQ(out.start[2], 20);  // the second ray misses
    EXPECT_NEAR(out.t[0], 2.05, 1e-6);
    EXPECT_NEAR(out.positions[0], -0.95, 1e-6);
}

TEST(March, SkippingGivesExactlyThePlainLoop) {
    const int n = 21;  // not a multiple of the blocks
    std::vector<std::uint8_t> cells(n * n * n, 0);
    const auto pick = random_values<float>(cells.size(), 11, 0, 1);
    const std::size_t count = 200;
    auto origins = random_values<float>(3 * count, 12, -2, 2);
    auto directions = unit_directions(count, 13);
    for (int c = 0; c < 3; ++c) {  // rays along the axes too, one of them in a face's plane
        for (int i = 0; i < 3; ++i) directions[3 * c + i] = i == c ? 1.0f : 0.0f;
    }
    origins[0] = -2;
    origins[1] = -1.2f;
    origins[2] = 0;
    const auto jitter = random_values<float>(count, 14, -0.5, 0.5);
    for (const auto& [step, occupied] :
         {std::pair(0.0031, 0.03f), {0.05, 0.03f}, {0.4, 0.03f}, {0.05, 0.001f}, {0.0031, 0.7f}, {0.05, 0.7f}}) {
        for (std::size_t i = 0; i < cells.size(); ++i) cells[i] = pick[i] < occupied;
        const MarchGrid grid = make_march_grid({-1, -1.2, -0.7}, {1, 0.9, 1.1}, n, cells);
        const MarchRays rays{origins, directions, jitter, step, 0.2};
        const auto out = march(grid, rays);
        for (std::size_t r = 0; r < count; ++r) {
            const std::vector<float> t(out.t.begin() + out.start[r], out.t.begin() + out.start[r + 1]);
            ASSERT_EQ(t, plain(grid, cells, rays, r)) << "ray " << r << ", step " << step;
        }
        const auto other = march(grid, rays, testing::backwards_for);
        ASSERT_EQ(other.positions, out.positions);
        ASSERT_EQ(other.ray, out.ray);
    }
}

TEST(March, NothingIsInAnEmptyGridAndNoRaysAreFine) {
    const std::vector<std::uint8_t> cells(8, 0);
    const MarchGrid grid = make_march_grid({0, 0, 0}, {1, 1, 1}, 2, cells);
    const std::vector<float> origins{0.5f, 0.5f, -1}, directions{0, 0, 1};
    EXPECT_TRUE(march(grid, {origins, directions, {}, 0.01, 0}).t.empty());
    EXPECT_TRUE(march(grid, {{}, {}, {}, 0.01, 0}).t.empty());
}

TEST(March, RefusesWhatMakesNoSense) {
    const MarchGrid grid = make_march_grid({0, 0, 0}, {1, 1, 1}, 0, {});
    const std::vector<float> origins{0, 0, 0};
    EXPECT_THROW(march(grid, {origins, origins, {}, 0, 0}), std::invalid_argument);
    EXPECT_THROW(march(grid, {origins, {}, {}, 0.1, 0}), std::invalid_argument);
    EXPECT_THROW(make_march_grid({0, 0, 0}, {1, 0, 1}, 0, {}), std::invalid_argument);
    EXPECT_THROW(make_march_grid({0, 0, 0}, {1, 1, 1}, 3, {}), std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
