#include "core/scene/camera.h"

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/scene/fixtures.h"

namespace fieldgraft {
namespace {

Camera plain_camera(int width = 400, int height = 300) {
    return camera_from_angle(width, height, 0.7, look_at({1, 2, 3}, {0, 0.5, 0}, {0, 0, 1}));
}

Vec3 vec(const Tensor& row) {
    return {row[0].item<double>(), row[1].item<double>(), row[2].item<double>()};
}

void expect_near(const Vec3& a, const Vec3& b, double tolerance) {
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(a[i], b[i], tolerance) << "component " << i;
}

TEST(Camera, LookAtIsRigidAndLooksThere) {
    const Mat4 pose = look_at({1, 2, 3}, {0, 0.5, 0}, {0, 0, 1});
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) EXPECT_NEAR(dot(column(pose, i), column(pose, j)), i == j ? 1 : 0, 1e-12);
    expect_near(cross(column(pose, 0), column(pose, 1)), column(pose, 2), 1e-12);
    expect_near(forward_of(pose), normalized(Vec3{-1, -1.5, -3}), 1e-12);
    EXPECT_GT(column(pose, 1)[2], 0);           // up is up
    EXPECT_NEAR(column(pose, 0)[2], 0, 1e-12);  // right is level
    for (const double value : look_at({0, 0, 2}, {0, 0, 0}, {0, 0, 1})) EXPECT_TRUE(std::isfinite(value));
}

TEST(Rays, CentreAndCornerMatchTheClosedForm) {
    const Camera camera = plain_camera(401, 301);
    const Rays rays = rays_through_pixels(camera, at::tensor({200, 150, 0, 0, 400, 300}, at::kLong).view({3, 2}));
    // The middle pixel of an odd image looks straight ahead.
    expect_near(vec(rays.directions[0]), camera.forward(), 1e-6);
    expect_near(vec(rays.origins[0]), {1, 2, 3}, 1e-6);
    // The first pixel's centre is 200 and 150 pixels off the axis, left and up.
    const double focal = 0.5 * 401 / std::tan(0.35);
    const Vec3 right = column(camera.camera_to_world, 0), up = column(camera.camera_to_world, 1);
    const Vec3 corner = normalized(camera.forward() + (-200 / focal) * right + (150 / focal) * up);
    expect_near(vec(rays.directions[1]), corner, 1e-6);
    const Vec3 other = normalized(camera.forward() + (200 / focal) * right + (-150 / focal) * up);
    expect_near(vec(rays.directions[2]), other, 1e-6);
    EXPECT_TRUE(at::allclose(rays.directions.norm(2, 1), at::ones({3})));
}

TEST(Rays, AllRaysOfAViewAreRowByRow) {
    const Camera camera = plain_camera(5, 3);
    const Rays all = rays_of_view(camera);
    ASSERT_EQ(all.size(), 15);
    const Rays some = rays_through_pixels(camera, at::tensor({3, 1}, at::kLong).view({1, 2}));
    EXPECT_TRUE(all.directions[1 * 5 + 3].equal(some.directions[0]));
    const Rays points = rays_through_points(camera, at::tensor({3.5, 1.5}, at::kDouble).view({1, 2}));
    EXPECT_TRUE(points.directions.equal(some.directions));
    EXPECT_EQ(rays_through_pixels(camera, at::empty({0, 2}, at::kLong)).size(), 0);
}

TEST(Rays, ManyCamerasAtOnce) {
    std::vector<Camera> cameras{plain_camera(8, 8), plain_camera(16, 4)};
    cameras[1].camera_to_world = ring_pose(1, 5);
    const Tensor pixels = at::tensor({7, 7, 15, 3, 0, 0}, at::kLong).view({3, 2});
    const Rays rays = rays_through_pixels(cameras, at::tensor({0, 1, 1}, at::kLong), pixels);
    for (int i = 0; i < 3; ++i) {
        const Rays one = rays_through_pixels(cameras[i == 0 ? 0 : 1], pixels.narrow(0, i, 1));
        EXPECT_TRUE(rays.directions[i].equal(one.directions[0]));
        EXPECT_TRUE(rays.origins[i].equal(one.origins[0]));
    }
    EXPECT_THROW(rays_through_pixels(cameras, at::tensor({0, 1, 2}, at::kLong), pixels), std::invalid_argument);
    EXPECT_THROW(rays_through_pixels(cameras, at::tensor({0, 1}, at::kLong), pixels), std::invalid_argument);
}

TEST(Rays, BadInputIsRefused) {
    const Camera camera = plain_camera(5, 3);
    EXPECT_THROW(rays_through_pixels(camera, at::tensor({5, 0}, at::kLong).view({1, 2})), std::invalid_argument);
    EXPECT_THROW(rays_through_pixels(camera, at::tensor({0, -1}, at::kLong).view({1, 2})), std::invalid_argument);
    EXPECT_THROW(rays_through_pixels(camera, at::zeros({1, 2})), std::invalid_argument);
    EXPECT_THROW(rays_through_pixels(camera, at::zeros({2}, at::kLong)), std::invalid_argument);
    Camera broken = camera;
    broken.fx = 0;
    EXPECT_THROW(rays_of_view(broken), std::invalid_argument);
    broken = camera;
    broken.camera_to_world[3] = std::nan("");
    EXPECT_THROW(rays_of_view(broken), std::invalid_argument);
}

TEST(Project, IsTheInverseOfRaysForEveryLens) {
    Random random(5);
    for (const Lens lens : {Lens::pinhole, Lens::opencv, Lens::fisheye}) {
        Camera camera = plain_camera();
        camera.cx += 7;
        camera.fy *= 1.1;
        camera.lens = lens;
        camera.distortion = {.k1 = 0.08, .k2 = -0.03, .k3 = 0.01, .k4 = 0.002, .p1 = 0.003, .p2 = -0.002};
        Tensor points = at::empty({200, 2}, at::kDouble);
        for (int i = 0; i < 200; ++i) {
            points[i][0] = random.uniform(0, 400);
            points[i][1] = random.uniform(0, 300);
        }
        const Rays rays = rays_through_points(camera, points);
        const Tensor back = project(camera, rays.origins + 3.0f * rays.directions);
        EXPECT_LT((back.narrow(1, 0, 2) - points).abs().max().item<double>(), 1e-3) << static_cast<int>(lens);
        EXPECT_GT(back.select(1, 2).min().item<double>(), 0.0);
    }
    const Camera camera = plain_camera();
    const Vec3 behind = camera.position() - camera.forward();
    EXPECT_LT(
        project(camera, at::tensor({behind[0], behind[1], behind[2]}, at::kDouble).view({1, 3}))[0][2].item<double>(),
        0);
}

// OpenCV's formula by hand for one point: u = 0.2, v = −0.1.
TEST(Project, DistortionMatchesTheFormula) {
    Camera camera;
    camera.width = camera.height = 100;
    camera.fx = camera.fy = 100;
    camera.cx = camera.cy = 50;
    camera.lens = Lens::opencv;
    camera.distortion = {.k1 = 0.1, .k2 = 0.2, .p1 = 0.01, .p2 = 0.02};
    const double u = 0.2, v = -0.1, r2 = 0.05, radial = 1 + 0.1 * r2 + 0.2 * r2 * r2;
    const Tensor p = project(camera, at::tensor({u, -v, -1.0}, at::kDouble).view({1, 3}));
    EXPECT_NEAR(p[0][0].item<double>(), 50 + 100 * (u * radial + 2 * 0.01 * u * v + 0.02 * (r2 + 2 * u * u)), 1e-9);
    EXPECT_NEAR(p[0][1].item<double>(), 50 + 100 * (v * radial + 2 * 0.02 * u * v + 0.01 * (r2 + 2 * v * v)), 1e-9);
}

TEST(Camera, ScaledViewsSeeTheSameThing) {
    const Camera camera = plain_camera(400, 300);
    const Camera half = scaled(camera, 0.5);
    EXPECT_EQ(half.width, 200);
    EXPECT_EQ(half.height, 150);
    const Rays a = rays_through_points(camera, at::tensor({100.0, 80.0}, at::kDouble).view({1, 2}));
    const Rays b = rays_through_points(half, at::tensor({50.0, 40.0}, at::kDouble).view({1, 2}));
    EXPECT_TRUE(at::allclose(a.directions, b.directions));
    // The square crop: its middle is the view's, its top edge the view's top edge.
    const Camera crop = square(camera, 64);
    const Rays c = rays_through_points(crop, at::tensor({0.0, 0.0}, at::kDouble).view({1, 2}));
    const Rays d = rays_through_points(camera, at::tensor({50.0, 0.0}, at::kDouble).view({1, 2}));
    EXPECT_TRUE(at::allclose(c.directions, d.directions, 1e-5, 1e-6));
    EXPECT_THROW(scaled(camera, 0), std::invalid_argument);
}

TEST(Frame, RoundTripsPointsPosesAndJson) {
    const double c = std::cos(0.7), s = std::sin(0.7);
    const Frame frame = Frame::make(2.5, {c, -s, 0, s, c, 0, 0, 0, 1}, {0.3, -4, 100});
    EXPECT_NEAR(frame.scale(), 2.5, 1e-12);
    expect_near(frame.point({1, 2, 3}), {2.5 * (c - 2 * s + 0.3), 2.5 * (s + 2 * c - 4), 2.5 * 103}, 1e-12);
    expect_near(frame.inverse().point(frame.point({1, 2, 3})), {1, 2, 3}, 1e-12);
    const Mat4 pose = ring_pose(2, 7);
    const Mat4 back = frame.inverse().pose(frame.pose(pose));
    for (int i = 0; i < 16; ++i) EXPECT_NEAR(back[i], pose[i], 1e-12);
    const Frame again = Frame::from_json(frame.to_json(), "here");
    for (int i = 0; i < 12; ++i) EXPECT_NEAR(again.matrix[i], frame.matrix[i], 1e-12);
    const Frame identity = compose(frame.inverse(), frame);
    for (int i = 0; i < 12; ++i) EXPECT_NEAR(identity.matrix[i], Frame{}.matrix[i], 1e-12);
}

TEST(Frame, RefusesWhatIsNoSimilarity) {
    EXPECT_THROW(Frame::make(0, {1, 0, 0, 0, 1, 0, 0, 0, 1}, {}), std::invalid_argument);
    EXPECT_THROW(Frame::make(1, {1, 0, 0, 0, 1, 0, 0, 0, -1}, {}), std::invalid_argument);
    EXPECT_THROW(Frame::make(1, {1, 0.1, 0, 0, 1, 0, 0, 0, 1}, {}), std::invalid_argument);
    EXPECT_THROW(Frame::make(1, {1, 0, 0, 0, 1, 0, 0, 0, 1}, {std::nan(""), 0, 0}), std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
