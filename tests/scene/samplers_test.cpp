#include <gtest/gtest.h>

#include <set>

#include "core/base/errors.h"
#include "core/scene/camera_sampler.h"
#include "core/scene/patch_sampler.h"
#include "tests/scene/fixtures.h"

namespace fieldgraft {
namespace {

TEST(Patch, StaysInsideReachesEveryPixelAndCountsAreEven) {
    Random random(2);
    for (const auto& [width, height, size] : {std::array{10, 7, 3}, {8, 8, 8}, {9, 17, 4}, {5, 5, 1}}) {
        std::set<std::pair<std::int64_t, std::int64_t>> seen;
        for (int i = 0; i < 1500; ++i) {
            const Patch patch = sample_patch(width, height, size, random);
            EXPECT_EQ(patch.stride_x, width / size);
            EXPECT_LT(patch.start_x, width / size + width % size);
            const Tensor pixels = patch.pixels();
            ASSERT_EQ(pixels.size(0), size * size);
            const auto* xy = pixels.data_ptr<std::int64_t>();
            for (int k = 0; k < size * size; ++k, xy += 2) {
                ASSERT_TRUE(xy[0] >= 0 && xy[0] < width && xy[1] >= 0 && xy[1] < height);
                seen.insert({xy[0], xy[1]});
            }
        }
        EXPECT_EQ(seen.size(), static_cast<std::size_t>(width * height));
    }
}

TEST(Patch, PixelsAreRowByRow) {
    const Patch patch{.start_x = 1, .start_y = 2, .stride_x = 3, .stride_y = 4, .size = 2};
    EXPECT_TRUE(patch.pixels().equal(at::tensor({1, 2, 4, 2, 1, 6, 4, 6}, at::kLong).view({4, 2})));
}

TEST(Patch, TooLargeIsAnInputError) {
    Random random(1);
    EXPECT_CONTAINS(message_of<InputError>([&] { sample_patch(10, 7, 8, random); }), "at most 7");
    EXPECT_THROW(sample_patch(10, 7, 0, random), std::invalid_argument);
}

TEST(Hemisphere, IsUniformAboveTheGroundAndLooksAtTheCentre) {
    HemisphereOptions options;
    options.centre = {1, 2, 3};
    options.up = {0, 2, 0};
    options.radius_min = 3;
    options.radius_max = 5;
    options.focus_radius = 0.2;
    options.intrinsics = camera_from_angle(64, 64, 0.7, identity4);
    Random random(9);
    double height = 0, height2 = 0, radius = 0;
    Vec3 around{0, 0, 0};
    constexpr int count = 20000;
    for (int i = 0; i < count; ++i) {
        const Camera camera = sample_hemisphere(options, random);
        const Vec3 offset = camera.position() - options.centre;
        const double r = length(offset), h = offset[1] / r;
        ASSERT_GE(r, 3 - 1e-9);
        ASSERT_LE(r, 5 + 1e-9);
        ASSERT_GE(h, -1e-9);
        // The axis passes the centre no farther away than the ball's radius.
        ASSERT_LE(length(cross(offset, camera.forward())), 0.2 + 1e-9);
        ASSERT_GT(dot(camera.forward(), offset), -r - 1e-9);
        ASSERT_LT(dot(camera.forward(), offset), 0);
        ASSERT_GT(dot(column(camera.camera_to_world, 1), options.up), -1e-9);
        EXPECT_EQ(camera.width, 64);
        height += h;
        height2 += h * h;
        radius += r;
        around = around + offset;
    }
    // Uniform over the area means a uniform height: mean ½, mean square ⅓.
    EXPECT_NEAR(height / count, 0.5, 5 * 0.289 / std::sqrt(count));
    EXPECT_NEAR(height2 / count, 1.0 / 3, 5 * 0.298 / std::sqrt(count));
    EXPECT_NEAR(radius / count, 4, 5 * 0.577 / std::sqrt(count));
    EXPECT_NEAR(around[0] / count, 0, 0.12);
    EXPECT_NEAR(around[2] / count, 0, 0.12);
}

TEST(Hemisphere, SameSeedSameCameraAndBadOptionsAreRefused) {
    HemisphereOptions options;
    options.intrinsics = camera_from_angle(8, 8, 0.7, identity4);
    Random a(4), b(4);
    EXPECT_EQ(sample_hemisphere(options, a).camera_to_world, sample_hemisphere(options, b).camera_to_world);
    options.radius_max = 1;
    EXPECT_THROW(sample_hemisphere(options, a), std::invalid_argument);
    options.radius_max = 4;
    options.focus_radius = 4;
    EXPECT_THROW(sample_hemisphere(options, a), std::invalid_argument);
    options.focus_radius = 0;
    options.elevation_min = 95;
    EXPECT_THROW(sample_hemisphere(options, a), std::invalid_argument);
}

// Seven cameras around the origin, `elevation` degrees up, over `sector` degrees of azimuth.
std::vector<Camera> arc(double elevation, double sector) {
    std::vector<Camera> cameras;
    const double e = elevation * std::numbers::pi / 180;
    for (int i = 0; i < 7; ++i) {
        const double azimuth = sector * i / 7 * std::numbers::pi / 180;
        const Vec3 eye{4 * std::cos(e) * std::cos(azimuth), 4 * std::cos(e) * std::sin(azimuth), 4 * std::sin(e)};
        cameras.push_back(camera_from_angle(8, 8, 0.7, look_at(eye, {0, 0, 0}, {0, 0, 1})));
    }
    return cameras;
}

TEST(ForwardFacing, IsAboutTheSidesThatWereSeen) {
    for (const double elevation : {0.0, 30.0, 45.0}) EXPECT_FALSE(is_forward_facing(arc(elevation, 360))) << elevation;
    EXPECT_TRUE(is_forward_facing(arc(75, 360)));  // from above only
    EXPECT_TRUE(is_forward_facing(arc(20, 60)));
    EXPECT_TRUE(is_forward_facing(arc(45, 140)));
    EXPECT_FALSE(is_forward_facing(arc(20, 200)));
    EXPECT_FALSE(is_forward_facing({}));
}

std::vector<Camera> wall_of_cameras() {
    std::vector<Camera> cameras;
    for (int i = 0; i < 5; ++i)
        for (int j = 0; j < 3; ++j)
            cameras.push_back(
                camera_from_angle(32, 24, 0.8, look_at({0.5 * i - 1, 0, 0.5 * j - 0.5}, {0, 6, 0}, {0, 0, 1})));
    return cameras;
}

TEST(NearPoses, StayNearAndRigid) {
    const std::vector<Camera> cameras = wall_of_cameras();
    ASSERT_TRUE(is_forward_facing(cameras));
    Random random(3);
    for (int n = 0; n < 500; ++n) {
        const Camera camera = sample_near_poses(cameras, {}, random);
        const Mat4& m = camera.camera_to_world;
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) ASSERT_NEAR(dot(column(m, i), column(m, j)), i == j ? 1 : 0, 1e-9);
        ASSERT_LT(std::abs(camera.position()[0]), 1.6);
        ASSERT_LT(std::abs(camera.position()[1]), 0.5);
        ASSERT_GT(camera.forward()[1], 0.9);
    }
    const Camera alone = sample_near_poses({cameras[4]}, {}, random);
    EXPECT_EQ(alone.position(), cameras[4].position());
    EXPECT_NE(alone.camera_to_world, cameras[4].camera_to_world);
    EXPECT_THROW(sample_near_poses({}, {}, random), std::invalid_argument);
}

TEST(Focus, IsWhereTheAxesMeet) {
    std::vector<Camera> ring;
    for (int i = 0; i < 7; ++i) ring.push_back(camera_from_angle(8, 8, 0.7, ring_pose(i, 7, 4, {1, -2, 0.5})));
    EXPECT_LT(length(focus_point(ring) - Vec3{1, -2, 0.5}), 1e-9);
    EXPECT_LT(length(focus_point(wall_of_cameras()) - Vec3{0, 6, 0}), 1e-9);
    // Parallel axes: somewhere in front.
    std::vector<Camera> parallel;
    for (int i = 0; i < 4; ++i)
        parallel.push_back(camera_from_angle(8, 8, 0.7, look_at({1.0 * i, 0, 0}, {1.0 * i, 1, 0}, {0, 0, 1})));
    const Vec3 focus = focus_point(parallel);
    EXPECT_NEAR(focus[0], 1.5, 1e-9);
    EXPECT_GT(focus[1], 0.5);
    const Vec3 single = focus_point({parallel[0]});
    EXPECT_NEAR(single[1], 1, 1e-9);
}

}  // namespace
}  // namespace fieldgraft
