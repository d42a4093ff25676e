// Camera paths and data set files: written, read back, and in the forms other programs write.
#include <gtest/gtest.h>

#include "core/base/errors.h"
#include "core/base/files.h"
#include "core/scene/camera_path.h"
#include "core/scene/dataset_writer.h"
#include "core/scene/scene.h"
#include "tests/scene/fixtures.h"

namespace fieldgraft {
namespace {

std::vector<Camera> ring(int n) {
    std::vector<Camera> cameras;
    for (int i = 0; i < n; ++i)
        cameras.push_back(camera_from_angle(12, 8, 0.8, ring_pose(i, n), "r_" + std::to_string(i)));
    return cameras;
}

void expect_same(const Camera& a, const Camera& b) {
    EXPECT_EQ(a.width, b.width);
    EXPECT_EQ(a.height, b.height);
    EXPECT_NEAR(a.fx, b.fx, 1e-9);
    EXPECT_NEAR(a.fy, b.fy, 1e-9);
    for (int i = 0; i < 16; ++i) EXPECT_NEAR(a.camera_to_world[i], b.camera_to_world[i], 1e-9);
}

TEST(CameraPath, WhatIsWrittenIsRead) {
    const TempFolder folder;
    const auto cameras = ring(4);
    write_camera_path(folder / "path.json", cameras, 30);
    const CameraPath path = read_camera_path(folder / "path.json");
    ASSERT_EQ(path.cameras.size(), 4u);
    for (int i = 0; i < 4; ++i) expect_same(path.cameras[i], cameras[i]);
    EXPECT_EQ(path.cameras[3].name, "00003");
    EXPECT_EQ(path.fps, 30);
    const Json file = read_json(folder / "path.json");
    for (const char* key : {"keyframes", "camera_type", "render_height", "render_width", "fps", "seconds", "is_cycle",
                            "smoothness_value", "camera_path", "default_fov", "default_transition_sec"})
        EXPECT_TRUE(file.contains(key)) << key;
    auto crooked = cameras;
    crooked[1].cx += 1;
    EXPECT_THROW(write_camera_path(folder / "no.json", crooked), std::invalid_argument);
}

TEST(CameraPath, KeyframesWithColumnMajorStrings) {
    const TempFolder folder;
    const Mat4 m = ring_pose(1, 5);
    std::string text = "[";
    for (int j = 0; j < 4; ++j)
        for (int i = 0; i < 4; ++i) text += fmt::format("{}{}", i + j > 0 ? ", " : "", m[4 * i + j]);
    text += "]";
    const Json file = {{"render_width", 12},
                       {"render_height", 8},
                       {"camera_type", "perspective"},
                       {"default_fov", 50},
                       {"keyframes", {{{"matrix", text}, {"fov", 40.0}}, {{"matrix", text}}}},
                       {"camera_path", Json::array()}};
    write_json(folder / "path.json", file);
    const CameraPath path = read_camera_path(folder / "path.json");
    ASSERT_EQ(path.cameras.size(), 2u);
    for (int i = 0; i < 16; ++i) EXPECT_NEAR(path.cameras[0].camera_to_world[i], m[i], 1e-9);
    EXPECT_NEAR(path.cameras[0].fy, 4 / std::tan(20 * std::numbers::pi / 180), 1e-9);
    EXPECT_NEAR(path.cameras[1].fy, 4 / std::tan(25 * std::numbers::pi / 180), 1e-9);
}

TEST(CameraPath, BrokenFilesAreInputErrors) {
    const TempFolder folder;
    write_camera_path(folder / "path.json", ring(2));
    const Json good = read_json(folder / "path.json");
    const auto refuse = [&](const Json& file) {
        write_json(folder / "bad.json", file);
        return message_of<InputError>([&] { read_camera_path(folder / "bad.json"); });
    };
    Json bad = good;
    bad["camera_path"][1]["camera_to_world"].erase(15);
    EXPECT_CONTAINS(refuse(bad), "camera_path[1]: not a matrix of 16 numbers");
    bad = good;
    bad["camera_path"][0].erase("fov");
    bad.erase("default_fov");
    EXPECT_CONTAINS(refuse(bad), "no \"fov\"");
    bad = good;
    bad["render_width"] = 0;
    EXPECT_CONTAINS(refuse(bad), "render_width");
    bad = good;
    bad["camera_type"] = "equirectangular";
    EXPECT_CONTAINS(refuse(bad), "perspective");
    EXPECT_CONTAINS(refuse(Json::array({1, 2})), "camera path is needed");
    EXPECT_CONTAINS(refuse(Json::object()), "camera path is needed");
}

TEST(DatasetWriter, SyntheticIsReadBack) {
    const TempFolder folder;
    const auto cameras = ring(5);
    write_nerf_synthetic(folder.path(), "train", cameras);
    for (const Camera& camera : cameras) write_plain_image(folder / ("train/" + camera.name + ".png"));
    const Scene scene = Scene::load(folder.path());
    ASSERT_EQ(scene.views("train").size(), 5u);
    for (int i = 0; i < 5; ++i) expect_same(scene.views()[i].camera, cameras[i]);
    auto other = cameras;
    other[2].fx = other[2].fy = 3;
    EXPECT_THROW(write_nerf_synthetic(folder.path(), "train", other), std::invalid_argument);
}

TEST(DatasetWriter, NerfstudioIsReadBackThroughTheFrame) {
    const TempFolder folder;
    auto cameras = ring(5);
    cameras[1].lens = Lens::opencv;
    cameras[1].distortion = {.k1 = 0.1, .p2 = 0.01};
    cameras[2].cy = 5;
    write_nerfstudio(folder.path(), cameras);
    for (const Camera& camera : cameras) write_plain_image(folder / ("images/" + camera.name + ".png"));
    const Scene scene = Scene::load(folder.path());
    ASSERT_EQ(scene.views().size(), 5u);
    for (int i = 0; i < 5; ++i) expect_same(transformed(scene.views()[i].camera, scene.frame().inverse()), cameras[i]);
    EXPECT_EQ(scene.views()[1].camera.distortion, cameras[1].distortion);
    EXPECT_EQ(scene.views()[2].camera.cy, 5);
}

}  // namespace
}  // namespace fieldgraft
