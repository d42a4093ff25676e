#include "core/render/hull.h"

#include "core/render/march.h"
#include "tests/render/edit_fixtures.h"

namespace fieldgraft {
namespace {

// A 64×64 camera at distance 4 that looks at the origin from (dx, dy, dz), and a mask: a disc of the ball's outline.
MaskView ball_view(Vec3 from, double radius) {
    const double norm = std::sqrt(from[0] * from[0] + from[1] * from[1] + from[2] * from[2]);
    const Vec3 back{from[0] / norm, from[1] / norm, from[2] / norm};
    const Vec3 helper = std::fabs(back[2]) < 0.9 ? Vec3{0, 0, 1} : Vec3{0, 1, 0};
    Vec3 right{helper[1] * back[2] - helper[2] * back[1], helper[2] * back[0] - helper[0] * back[2],
               helper[0] * back[1] - helper[1] * back[0]};
    const double length = std::sqrt(right[0] * right[0] + right[1] * right[1] + right[2] * right[2]);
    for (double& x : right) x /= length;
    const Vec3 up{back[1] * right[2] - back[2] * right[1], back[2] * right[0] - back[0] * right[2],
                  back[0] * right[1] - back[1] * right[0]};
    Mat4 pose = identity4;
    for (int row = 0; row < 3; ++row) {
        pose[4 * row] = right[row];
        pose[4 * row + 1] = up[row];
        pose[4 * row + 2] = back[row];
        pose[4 * row + 3] = 4 * back[row];
    }
    MaskView view;
    view.camera = camera_from_angle(64, 64, 0.9, pose);
    const double outline = view.camera.fx * radius / std::sqrt(16 - radius * radius);
    const Tensor line = at::arange(64, at::kFloat) + 0.5 - 32;
    view.mask = (line.unsqueeze(0).square() + line.unsqueeze(1).square()).lt(outline * outline);
    return view;
}

std::vector<MaskView> ball_views() {
    return {ball_view({1, 0, 0.2}, 0.8), ball_view({0, 1, 0.2}, 0.8), ball_view({-1, 0.3, 0.5}, 0.8),
            ball_view({0.2, 0, 1}, 0.8), ball_view({-0.5, -1, 0.4}, 0.8)};
}

TEST(Hull, OfABallHoldsTheBallAndNotMuchMore) {
    HullOptions options;
    options.resolution = 32;
    options.share = 1;
    const FieldGeometry geometry;
    const Tensor hull = visual_hull(geometry, ball_views(), options);
    const Tensor inner = ball_cells(geometry, 32, {0, 0, 0}, 0.75f), outer = ball_cells(geometry, 32, {0, 0, 0}, 1.15f);
    EXPECT_EQ(inner.logical_and(hull.eq(0)).sum().item<std::int64_t>(), 0);
    EXPECT_EQ(hull.logical_and(outer.eq(0)).sum().item<std::int64_t>(), 0);
}

TEST(Hull, SurvivesOneWrongMask) {
    std::vector<MaskView> views = ball_views();
    views[1].mask = at::zeros_like(views[1].mask);
    HullOptions options;
    options.resolution = 32;
    options.share = 1;
    EXPECT_EQ(visual_hull(FieldGeometry{}, views, options).sum().item<std::int64_t>(), 0);  // a hard hull dies of it
    options.share = 0.7;
    const Tensor hull = visual_hull(FieldGeometry{}, views, options);
    const Tensor inner = ball_cells(FieldGeometry{}, 32, {0, 0, 0}, 0.75f);
    EXPECT_EQ(inner.logical_and(hull.eq(0)).sum().item<std::int64_t>(), 0);
}

TEST(Hull, GrowsByCells) {
    HullOptions options;
    options.resolution = 24;
    const Tensor tight = visual_hull(FieldGeometry{}, ball_views(), options);
    options.grow = 2;
    EXPECT_TRUE(same_bits(visual_hull(FieldGeometry{}, ball_views(), options), dilated(tight, 2)));
    EXPECT_GT(dilated(tight, 2).sum().item<std::int64_t>(), tight.sum().item<std::int64_t>());
}

// What lies behind the surface that a view's depth map shows is not that view's to judge.
TEST(Hull, DepthHidesWhatLiesBehind) {
    MaskView view = ball_view({1, 0, 0}, 0.8);
    view.mask = at::ones_like(view.mask);
    view.depth = at::full({64, 64}, 4.0f);  // a wall through the origin
    HullOptions options;
    options.resolution = 16;
    options.min_views = 1;
    const Tensor votes = hull_votes(FieldGeometry{}, {view}, options);  // (z, y, x), the camera at x = +4
    EXPECT_EQ(votes[8][8][13].item<float>(), 1);
    EXPECT_EQ(votes[8][8][2].item<float>(), -1);
}

TEST(Hull, BadInputIsNamed) {
    EXPECT_THROW(visual_hull(FieldGeometry{}, {}, {}), std::invalid_argument);
    std::vector<MaskView> views = ball_views();
    views[0].mask = at::ones({4});
    EXPECT_THROW(visual_hull(FieldGeometry{}, views, {}), std::invalid_argument);
    HullOptions options;
    options.share = 0;
    EXPECT_THROW(visual_hull(FieldGeometry{}, ball_views(), options), std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
