// Dilation and the regions M₊ and M₋ against their definitions.
#include "core/edit/mask_ops.h"

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace fieldgraft {
namespace {

Tensor dot(int size, int y, int x) {
    Tensor mask = at::zeros({size, size}, at::kBool);
    mask.index_put_({at::tensor({y}), at::tensor({x})}, true);
    return mask;
}

TEST(Dilate, SquareClippedAtTheBorder) {
    EXPECT_EQ(dilate(dot(11, 5, 5), 2).sum().item<int>(), 25);
    EXPECT_EQ(dilate(dot(11, 0, 0), 2).sum().item<int>(), 9);
    EXPECT_EQ(dilate(dot(11, 5, 5), 0).sum().item<int>(), 1);
    EXPECT_EQ(dilate(at::zeros({7, 9}, at::kBool), 3).sum().item<int>(), 0);
}

TEST(Dilate, IsRepeatedFiveByFive) {
    // Three 5×5 dilations are one of radius 6, also for a ragged mask on a non-square image.
    Random random(7);
    Tensor mask = at::zeros({31, 45}, at::kBool);
    for (int i = 0; i < 12; ++i) mask[random.below(31)][random.below(45)] = true;
    Tensor repeated = mask;
    for (int i = 0; i < 3; ++i) repeated = dilate(repeated, 2);
    EXPECT_TRUE(at::equal(repeated, dilate(mask, dilation_radius(3, 352))));
}

TEST(Dilate, RadiusFollowsTheImageSize) {
    EXPECT_EQ(dilation_radius(10, 352), 20);
    EXPECT_EQ(dilation_radius(10, 176), 10);
    EXPECT_EQ(dilation_radius(3, 64), 1);
    EXPECT_THROW(dilation_radius(-1, 64), std::invalid_argument);
}

TEST(RegionMasks, PositiveAndNegativeAreDisjoint) {
    const RegionMasks masks = region_masks(dot(352, 176, 176), 10, 88);
    EXPECT_FALSE(masks.positive.logical_and(masks.negative).any().item<bool>());
    // 41 pixels of 352 become about 41/4 of 88 along each axis; 81 for the complement of M₋.
    EXPECT_NEAR(masks.positive.sum().item<double>(), 10.25 * 10.25, 12);
    EXPECT_NEAR(masks.negative.logical_not().sum().item<double>(), 20.25 * 20.25, 22);
}

TEST(RegionMasks, NothingFoundMeansEverythingOutside) {
    const RegionMasks masks = region_masks(at::zeros({64, 64}, at::kBool), 3, 32);
    EXPECT_EQ(masks.positive.sum().item<int>(), 0);
    EXPECT_EQ(masks.negative.sum().item<int>(), 32 * 32);
}

TEST(ResizeNearest, PicksPixelCentres) {
    const Tensor mask = at::tensor({1, 0, 0, 1}).to(at::kBool).reshape({2, 2});
    EXPECT_TRUE(
        at::equal(resize_nearest(mask, 4, 4).slice(0, 0, 1).reshape(-1), at::tensor({1, 1, 0, 0}).to(at::kBool)));
    EXPECT_TRUE(at::equal(resize_nearest(mask, 2, 2), mask));
    EXPECT_THROW(resize_nearest(at::zeros({2, 2}), 4, 4), std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
