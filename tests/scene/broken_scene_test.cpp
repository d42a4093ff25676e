// Files as they should not be: each gives one line that says what, where, and what would be right; or is read all the
// same.
#include <gtest/gtest.h>

#include "core/base/errors.h"
#include "core/base/files.h"
#include "core/scene/scene.h"
#include "tests/scene/fixtures.h"

namespace fieldgraft {
namespace fs = std::filesystem;

namespace {

class BrokenScene : public testing::Test {
  protected:
    BrokenScene() : file_(synthetic_split(folder_.path(), "train", 3)) {}

    void write() { write_json(folder_ / "transforms_train.json", file_); }
    std::string refuse() {
        write();
        return message_of<InputError>([&] { Scene::load(folder_.path()); });
    }
    Json& frame(int i = 1) { return file_["frames"][i]; }

    TempFolder folder_;
    Json file_;
};

TEST_F(BrokenScene, NothingThere) {
    const TempFolder empty;
    EXPECT_CONTAINS(message_of<InputError>([&] { Scene::load(empty / "none"); }), "no such file or folder");
    EXPECT_CONTAINS(message_of<InputError>([&] { Scene::load(empty.path()); }), "transforms_train.json");
    fs::create_directories(empty / "sparse");
    EXPECT_CONTAINS(message_of<InputError>([&] { Scene::load(empty.path()); }), "COLMAP");
}

TEST_F(BrokenScene, MissingKeys) {
    frame().erase("transform_matrix");
    EXPECT_CONTAINS(refuse(), "transforms_train.json frame 1 (./train/r_1): no \"transform_matrix\"");
    frame().erase("file_path");
    EXPECT_CONTAINS(refuse(), "frame 1: no \"file_path\"");
    file_["frames"] = Json::array();
    EXPECT_CONTAINS(refuse(), "empty");
    file_.erase("frames");
    EXPECT_CONTAINS(refuse(), "no \"frames\"");
}

TEST_F(BrokenScene, NoFocalLength) {
    file_.erase("camera_angle_x");
    EXPECT_CONTAINS(refuse(), "no focal length");
    file_["camera_angle_x"] = 4.0;
    EXPECT_CONTAINS(refuse(), "camera_angle_x");
    file_["camera_angle_x"] = "wide";
    EXPECT_CONTAINS(refuse(), "finite number");
    file_["camera_angle_x"] = 0.8;
    file_["camera_model"] = "EQUIRECTANGULAR";
    EXPECT_CONTAINS(refuse(), "OPENCV_FISHEYE");
}

TEST_F(BrokenScene, Poses) {
    const Json good = frame()["transform_matrix"];
    const auto with = [&](int i, int j, const Json& value) {
        frame()["transform_matrix"] = good;
        frame()["transform_matrix"][i][j] = value;
        return refuse();
    };
    EXPECT_CONTAINS(with(1, 2, nullptr), "transform_matrix[1][2] is null");
    EXPECT_CONTAINS(with(0, 0, "x"), "finite numbers");
    EXPECT_CONTAINS(with(3, 3, 2), "last row");
    EXPECT_CONTAINS(with(0, 1, 0.9), "rigid");
    frame()["transform_matrix"] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, -1, 0}, {0, 0, 0, 1}};
    EXPECT_CONTAINS(refuse(), "mirrors");
    frame()["transform_matrix"] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 1, 0, 0}, {0, 0, 0, 1}};
    EXPECT_CONTAINS(refuse(), "singular");
    frame()["transform_matrix"] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    EXPECT_CONTAINS(refuse(), "4 rows of 4");
    // NaN is no JSON, but Python writes it.
    frame()["transform_matrix"] = good;
    std::string text = file_.dump();
    const auto at = text.find("0.1");
    write_file(folder_ / "transforms_train.json", text.replace(at, 3, "NaN"));
    EXPECT_CONTAINS(message_of<InputError>([&] { Scene::load(folder_.path()); }), "NaN");
}

TEST_F(BrokenScene, Images) {
    fs::remove(folder_ / "train/r_1.png");
    EXPECT_CONTAINS(refuse(), "tried train/r_1.png");
    write_file(folder_ / "train/r_1.png", "not a picture");
    EXPECT_CONTAINS(refuse(), "not an image");
    write_plain_image(folder_ / "train/r_1.png");
    file_["w"] = 800;
    EXPECT_CONTAINS(refuse(), "12×8 pixels, but the file says w = 800");
    file_.erase("w");
    write();
    // Cut after its header: found when it is decoded.
    const std::string bytes = read_file(folder_ / "train/r_1.png");
    write_file(folder_ / "train/r_1.png", bytes.substr(0, bytes.size() - 20));
    const Scene scene = Scene::load(folder_.path());
    EXPECT_CONTAINS(message_of<InputError>([&] { scene.image(scene.views()[1]); }), "truncated");
}

TEST_F(BrokenScene, PathsThatLeaveTheFolder) {
    for (const std::string path : {"/etc/passwd", "C:\\images\\a.png", "../other/a.png", "train/../../a.png", ""}) {
        frame()["file_path"] = path;
        const std::string text = refuse();
        EXPECT_CONTAINS(text, "frame 1");
        EXPECT_TRUE(text.find("absolute") != std::string::npos || text.find("out of") != std::string::npos ||
                    text.find("empty") != std::string::npos)
            << text;
    }
}

TEST_F(BrokenScene, VariantsThatCanBeRead) {
    // Extension in the path, doubled extension, Windows slashes, a token in front, a doubled folder, only 3 rows, a
    // scaled pose.
    write_plain_image(folder_ / "train/0007.png");
    const Json good = frame()["transform_matrix"];
    for (const std::string path : {"train/r_1.png", "train/r_1.png.png", ".\\train\\r_1", "train/train/r_1.png",
                                   "train/frame_3.png0007.png", "train/./r_1"}) {
        frame()["file_path"] = path;
        write();
        EXPECT_EQ(Scene::load(folder_.path()).views().size(), 3u) << path;
    }
    frame()["file_path"] = "train/r_1.png.png";
    frame()["transform_matrix"].erase(3);
    write();
    const Scene scene = Scene::load(folder_.path());
    ASSERT_EQ(scene.warnings().size(), 1u);
    EXPECT_CONTAINS(scene.warnings()[0], "was taken for it");
    frame()["transform_matrix"] = good;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) frame()["transform_matrix"][i][j] = 2.5 * good[i][j].get<double>();
    write();
    const Scene scaled = Scene::load(folder_.path());
    EXPECT_NEAR(length(scaled.views()[1].camera.forward()), 1, 1e-12);
    EXPECT_EQ(scaled.warnings().size(), 2u);
}

TEST_F(BrokenScene, Options) {
    write();
    SceneOptions options;
    options.downscale = 0;
    EXPECT_CONTAINS(message_of<InputError>([&] { Scene::load(folder_.path(), options); }), "factor");
    options = {};
    options.box = Bounds{{1, 1, 1}, {-1, 2, 2}};
    EXPECT_CONTAINS(message_of<InputError>([&] { Scene::load(folder_.path(), options); }), "box");
}

}  // namespace
}  // namespace fieldgraft
