#include "core/field/cells.h"

#include <gtest/gtest.h>

namespace fieldgraft {
namespace {

TEST(Cells, ResamplingKeepsEveryMarkedPlace) {
    Tensor grid = at::zeros({5, 5, 5}, at::kByte);
    grid[1][2][3] = 1;
    for (const int resolution : {1, 3, 5, 8, 13}) {
        const Tensor other = resampled_cells(grid, resolution);
        const Tensor cells = at::arange(std::int64_t{1} * 125, at::kLong);
        const Tensor points = cell_points(FieldGeometry{}, 5, cells, {0.3, 0.6, 0.9});
        const Tensor before = in_cells(FieldGeometry{}, grid, points), after = in_cells(FieldGeometry{}, other, points);
        EXPECT_EQ(before.sum().item<std::int64_t>(), 1);
        EXPECT_TRUE(before.logical_and(after.logical_not()).logical_not().all().item<bool>()) << resolution;
    }
    EXPECT_EQ(resampled_cells(grid, 10).sum().item<std::int64_t>(), 8);
}

TEST(Cells, UnionAndGrowth) {
    Tensor a = at::zeros({5, 5, 5}, at::kByte), b = a.clone();
    a[0][0][0] = 7;
    b[4][2][1] = 1;
    const Tensor both = union_of(a, b);
    EXPECT_EQ(both.sum().item<std::int64_t>(), 2);
    EXPECT_EQ(both.max().item<int>(), 1);
    EXPECT_EQ(dilated(a, 1).sum().item<std::int64_t>(), 8);
    EXPECT_EQ(dilated(b, 1).sum().item<std::int64_t>(), 2 * 3 * 3);
    EXPECT_EQ(dilated(b, 9).sum().item<std::int64_t>(), 125);
    EXPECT_TRUE(at::equal(dilated(b, 0), b));
    EXPECT_THROW(union_of(a, at::zeros({4, 4, 4}, at::kByte)), std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
