#include "core/scene/scene.h"

#include <gtest/gtest.h>

#include "core/base/errors.h"
#include "core/base/files.h"
#include "tests/scene/fixtures.h"

namespace fieldgraft {
namespace fs = std::filesystem;

namespace {

TEST(SyntheticScene, LoadsSplitsImagesAndTheFilesOwnWorld) {
    const TempFolder folder;
    write_json(folder / "transforms_train.json", synthetic_split(folder.path(), "train", 5));
    write_json(folder / "transforms_test.json", synthetic_split(folder.path(), "test", 3));
    for (const std::string path : {"", "transforms_train.json", "transforms_test.json"}) {
        const Scene scene = Scene::load(folder / path);
        EXPECT_EQ(scene.views("train").size(), 5u);
        EXPECT_EQ(scene.views("val").size(), 0u);
        EXPECT_EQ(scene.views("test").size(), 3u);
        EXPECT_EQ(scene.validation_views().size(), 3u);
    }
    const Scene scene = Scene::load(folder.path());
    EXPECT_EQ(scene.frame(), Frame{});
    EXPECT_EQ(scene.bounds(), Bounds{});
    EXPECT_TRUE(scene.has_alpha());
    EXPECT_FALSE(scene.forward_facing());
    EXPECT_TRUE(scene.warnings().empty());
    const View& view = scene.view("r_2", "train");
    EXPECT_EQ(view.camera.width, 12);
    EXPECT_EQ(view.camera.height, 8);
    EXPECT_NEAR(view.camera.fx, 6 / std::tan(0.4), 1e-12);
    EXPECT_EQ(view.camera.fx, view.camera.fy);
    EXPECT_EQ(view.camera.cx, 6);
    const Mat4 expected = ring_pose(2, 5);
    for (int i = 0; i < 16; ++i) EXPECT_NEAR(view.camera.camera_to_world[i], expected[i], 1e-12);
    EXPECT_TRUE(scene.image(view).equal(at::full({8, 12, 4}, 128.0f / 255)));
    EXPECT_EQ(scene.pixels(view).scalar_type(), at::kByte);
    EXPECT_NEAR(scene.radius_range()[0], 4, 1e-3);
    EXPECT_NEAR(scene.radius_range()[1], 4, 1e-3);
    EXPECT_LT(length(scene.centre()), 1e-3);
}

TEST(SyntheticScene, OptionsChooseSplitsReduceImagesAndSetTheBox) {
    const TempFolder folder;
    write_json(folder / "transforms_train.json", synthetic_split(folder.path(), "train", 3));
    write_json(folder / "transforms_test.json", synthetic_split(folder.path(), "test", 2));
    SceneOptions options;
    options.splits = {"train"};
    options.downscale = 2;
    options.box = Bounds{{-1, -2, -3}, {1, 2, 3}};
    const Scene scene = Scene::load(folder.path(), options);
    EXPECT_EQ(scene.views().size(), 3u);
    EXPECT_EQ(scene.image(scene.views()[0]).sizes(), at::IntArrayRef({4, 6, 4}));
    EXPECT_NEAR(scene.views()[0].camera.fx, 3 / std::tan(0.4), 1e-12);
    EXPECT_EQ(scene.bounds(), *options.box);
    // A split that is not wanted may be incomplete.
    fs::remove(folder / "test/r_1.png");
    EXPECT_EQ(Scene::load(folder.path(), options).views().size(), 3u);
    EXPECT_CONTAINS(message_of<InputError>([&] { Scene::load(folder.path()); }), "r_1");
    options.splits = {"val"};
    EXPECT_CONTAINS(message_of<InputError>([&] { Scene::load(folder.path(), options); }), "no views");
    options.splits = {"training"};
    EXPECT_CONTAINS(message_of<InputError>([&] { Scene::load(folder.path(), options); }), "train, val and test");
}

TEST(SyntheticScene, ViewsAreFoundByNameAndAmbiguityIsNamed) {
    const TempFolder folder;
    write_json(folder / "transforms_train.json", synthetic_split(folder.path(), "train", 2));
    write_json(folder / "transforms_test.json", synthetic_split(folder.path(), "test", 2));
    const Scene scene = Scene::load(folder.path());
    EXPECT_EQ(scene.view("test/r_1").split, "test");
    EXPECT_EQ(scene.view("r_1.png", "train").split, "train");
    EXPECT_CONTAINS(message_of<InputError>([&] { scene.view("r_1"); }), "train/r_1 and test/r_1");
    EXPECT_CONTAINS(message_of<InputError>([&] { scene.view("r_9"); }), "no view 'r_9'");
}

TEST(NerfstudioScene, SortsSplitsAndPlacesWithAnInvertibleFrame) {
    const TempFolder folder;
    const Vec3 centre{5, -2, 1};
    write_json(folder / "transforms.json", nerfstudio_file(folder.path(), 17, centre));
    const Scene scene = Scene::load(folder.path());
    EXPECT_EQ(scene.views("test").size(), 3u);
    EXPECT_EQ(scene.views("train").size(), 14u);
    EXPECT_EQ(scene.views()[0].camera.name, "1000");
    EXPECT_EQ(scene.views()[8].split, "test");
    EXPECT_FALSE(scene.has_alpha());
    const Camera& camera = scene.views()[3].camera;
    EXPECT_EQ(camera.fx, 10);
    EXPECT_EQ(camera.fy, 11);
    EXPECT_EQ(camera.cx, 6.5);
    // Opaque images: the cameras are within ±1 of what they look at, and some camera reaches 1.
    double reach = 0;
    for (const View& view : scene.views())
        for (const double value : view.camera.position()) reach = std::max(reach, std::abs(value));
    EXPECT_NEAR(reach, 1, 1e-6);
    EXPECT_LT(length(scene.frame().point(centre)), 1e-6);
    EXPECT_EQ(scene.bounds(), Bounds{});
    for (int i = 0; i < 17; ++i) {
        const Mat4 back = scene.frame().inverse().pose(scene.views()[i].camera.camera_to_world);
        const Mat4 original = ring_pose(i, 17, 8, centre);
        for (int k = 0; k < 16; ++k) EXPECT_NEAR(back[k], original[k], 1e-9);
    }
}

TEST(NerfstudioScene, AlphaMakesTheBoxHoldWhatIsSeen) {
    const TempFolder folder;
    write_json(folder / "transforms.json", nerfstudio_file(folder.path(), 8, {5, -2, 1}, 4));
    const Scene scene = Scene::load(folder.path());
    // Cameras 8 away that see 6/10 of their distance to each side: 4.8 becomes 1.5.
    EXPECT_NEAR(scene.frame().scale(), 1.5 / 4.8, 2e-4);
    EXPECT_NEAR(scene.radius_range()[1], 8 * 1.5 / 4.8, 2e-3);
}

// A field is trained with one choice of splits and rendered with another: the frame must be the same, mixed images or
// not.
TEST(NerfstudioScene, TheFrameDoesNotDependOnTheSplitsRead) {
    const TempFolder folder;
    write_json(folder / "transforms.json", nerfstudio_file(folder.path(), 17));
    write_plain_image(folder / "images/1003.png", 12, 8, 4);
    SceneOptions train, test;
    train.splits = {"train"};
    test.splits = {"test"};
    const Scene scene = Scene::load(folder.path());
    EXPECT_EQ(Scene::load(folder.path(), train).frame(), scene.frame());
    EXPECT_EQ(Scene::load(folder.path(), test).frame(), scene.frame());
    EXPECT_FALSE(Scene::load(folder.path(), test).has_alpha());
}

TEST(NerfstudioScene, MeanUpBecomesZUnlessOverridden) {
    const TempFolder folder;
    Json file = nerfstudio_file(folder.path(), 8, {0, 0, 0});
    // The whole world turned: its up is now +X.
    const Frame turn = Frame::make(1, {0, 0, 1, 0, 1, 0, -1, 0, 0}, {});
    for (int i = 0; i < 8; ++i) file["frames"][i]["transform_matrix"] = rows_of(turn.pose(ring_pose(7 - i, 8, 8)));
    write_json(folder / "transforms.json", file);
    Vec3 up{0, 0, 0};
    const Scene upright = Scene::load(folder.path());
    for (const View& view : upright.views()) up = up + column(view.camera.camera_to_world, 1);
    EXPECT_GT(normalized(up)[2], 0.999);
    file["orientation_override"] = "none";
    write_json(folder / "transforms.json", file);
    const Scene lying = Scene::load(folder.path());
    up = {0, 0, 0};
    for (const View& view : lying.views()) up = up + column(view.camera.camera_to_world, 1);
    EXPECT_GT(normalized(up)[0], 0.999);
}

TEST(NerfstudioScene, AppliedTransformBelongsToTheFrame) {
    const TempFolder folder;
    Json file = nerfstudio_file(folder.path(), 8, {1, 2, 3});
    file["applied_transform"] = {{1, 0, 0, 0.5}, {0, 0, 1, 0}, {0, -1, 0, 0}};
    file["applied_scale"] = 2.0;
    write_json(folder / "transforms.json", file);
    const Scene scene = Scene::load(folder.path());
    // original (x, y, z) → file 2·(x + ½, z, −y): the file's centre (1, 2, 3) was (0, −1.5, 1).
    EXPECT_LT(length(scene.frame().point({0, -1.5, 1})), 1e-6);
}

TEST(NerfstudioScene, UsesTheTransformsOfATrainedModel) {
    const TempFolder folder;
    Json file = nerfstudio_file(folder.path(), 8, {1, 2, 3});
    file["applied_transform"] = {{1, 0, 0, 0}, {0, 0, 1, 0}, {0, -1, 0, 0}};
    write_json(folder / "transforms.json", file);
    const Json trained = {{"transform", {{0, 1, 0, 0.1}, {-1, 0, 0, 0.2}, {0, 0, 1, 0.3}}}, {"scale", 0.25}};
    write_json(folder / "dataparser_transforms.json", trained);
    const Scene scene = Scene::load(folder.path());
    const Frame expected = Frame::from_json(trained, "");
    for (int i = 0; i < 12; ++i) EXPECT_NEAR(scene.frame().matrix[i], expected.matrix[i], 1e-12);
    // file position p comes from the original (p.x, −p.z, p.y).
    const Vec3 p = position_of(ring_pose(0, 8, 8, {1, 2, 3}));
    const Vec3 placed = scene.view("1000").camera.position();
    const Vec3 wanted = expected.point({p[0], -p[2], p[1]});
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(placed[i], wanted[i], 1e-9);
    write_json(folder / "dataparser_transforms.json", {{"scale", 1}});
    EXPECT_CONTAINS(message_of<InputError>([&] { Scene::load(folder.path()); }), "dataparser_transforms.json");
}

TEST(NerfstudioScene, FilenameListsDecideTheSplits) {
    const TempFolder folder;
    Json file = nerfstudio_file(folder.path(), 8);
    file["train_filenames"] = {"images/1001.png", "./images/1002.png"};
    file["val_filenames"] = {"images/1003.png"};
    file["test_filenames"] = {"images/1003.png", "images/1004.png"};
    write_json(folder / "transforms.json", file);
    const Scene scene = Scene::load(folder.path());
    EXPECT_EQ(scene.views("train").size(), 2u);
    EXPECT_EQ(scene.views("test").size(), 2u);
    ASSERT_EQ(scene.warnings().size(), 1u);
    EXPECT_CONTAINS(scene.warnings()[0], "4 frames");
    file["train_filenames"].push_back("images/2000.png");
    write_json(folder / "transforms.json", file);
    EXPECT_CONTAINS(message_of<InputError>([&] { Scene::load(folder.path()); }), "images/2000.png");
}

TEST(NerfstudioScene, MasksAndPerFrameIntrinsics) {
    const TempFolder folder;
    Json file = nerfstudio_file(folder.path(), 3);
    Tensor mask = at::ones({8, 12});
    mask[2].fill_(0);
    write_png(folder / "masks/a.png", mask);
    file["frames"][0]["mask_path"] = "masks/a.png";
    file["frames"][1]["fl_x"] = 20;
    file["frames"][1]["k1"] = 0.1;
    write_json(folder / "transforms.json", file);
    const Scene scene = Scene::load(folder.path());
    const Tensor kept = scene.mask(scene.view("1002"));
    EXPECT_TRUE(kept.equal(mask > 0.5));
    EXPECT_FALSE(scene.mask(scene.view("1001")).defined());
    EXPECT_EQ(scene.view("1001").camera.fx, 20);
    EXPECT_EQ(scene.view("1001").camera.lens, Lens::opencv);
    EXPECT_EQ(scene.view("1000").camera.lens, Lens::pinhole);
    write_png(folder / "masks/a.png", at::ones({8, 11}));
    EXPECT_CONTAINS(message_of<InputError>([&] { Scene::load(folder.path()); }), "must agree");
}

TEST(NgpScene, FocalPrecedenceAndBox) {
    const TempFolder folder;
    Json file = synthetic_split(folder.path(), "images", 4);
    file["aabb_scale"] = 1;
    const auto focal = [&] {
        write_json(folder / "transforms.json", file);
        const Camera camera = Scene::load(folder.path()).views()[0].camera;
        return std::pair(camera.fx, camera.fy);
    };
    const double from_angle = 6 / std::tan(0.4);
    EXPECT_NEAR(focal().first, from_angle, 1e-12);
    EXPECT_NEAR(focal().second, from_angle, 1e-12);
    file["fl_x"] = 33;
    EXPECT_NEAR(focal().first, 33, 1e-12);
    EXPECT_NEAR(focal().second, 33, 1e-12);
    file["x_fov"] = 90;
    EXPECT_NEAR(focal().first, 6, 1e-12);
    file["y_fov"] = 90;
    EXPECT_NEAR(focal().second, 4, 1e-12);

    file["scale"] = 0.25;
    file["offset"] = {0.25, 0.5, 0.75};
    write_json(folder / "transforms.json", file);
    const Scene scene = Scene::load(folder.path());
    // Box side 1/0.25 about (1, 0, −1), so ±2 becomes ±1.5 unless the views hold less: 4·tan 45° is more.
    EXPECT_LT(length(scene.frame().point({1, 0, -1})), 1e-12);
    EXPECT_NEAR(scene.frame().scale(), 0.75, 1e-12);
    file["aabb_scale"] = 64;
    write_json(folder / "transforms.json", file);
    EXPECT_GT(Scene::load(folder.path()).frame().scale(), 0.2);
}

TEST(Scene, OutOfMemory) {
    std::vector<Camera> cameras;
    std::vector<Tensor> images;
    for (int i = 0; i < 3; ++i) {
        cameras.push_back(camera_from_angle(6, 4, 0.7, ring_pose(i, 3)));
        images.push_back(at::full({4, 6, i == 1 ? 4 : 3}, 0.25f * static_cast<float>(i)));
    }
    const Scene scene = Scene::from_images(cameras, images, {{-1, -1, -1}, {1, 1, 1}}, {"train", "train", "test"});
    EXPECT_EQ(scene.views("train").size(), 2u);
    EXPECT_TRUE(scene.has_alpha());
    EXPECT_EQ(scene.image(scene.views()[0]).sizes(), at::IntArrayRef({4, 6, 4}));
    EXPECT_EQ(scene.image(scene.views()[2])[0][0][3].item<float>(), 1.0f);
    images.pop_back();
    EXPECT_THROW(Scene::from_images(cameras, images), std::invalid_argument);
}

TEST(Scene, LinearPremultipliedExrIsConverted) {
    const TempFolder folder;
    Json file = synthetic_split(folder.path(), "train", 1);
    fs::remove(folder / "train/r_0.png");
    Tensor image = at::full({8, 12, 4}, 0.107f);  // 0.214 at alpha ½: linear 0.214 is sRGB 0.5
    image.select(2, 3).fill_(0.5f);
    write_exr(folder / "train/r_0.exr", image);
    write_json(folder / "transforms_train.json", file);
    const Scene scene = Scene::load(folder.path());
    const Tensor pixel = scene.image(scene.views()[0])[3][3];
    EXPECT_NEAR(pixel[0].item<float>(), 0.5f, 0.003f);
    EXPECT_NEAR(pixel[3].item<float>(), 0.5f, 0.003f);
}

TEST(LegoScene, Loads) {
    const fs::path lego = fs::path(FIELDGRAFT_SOURCE_DIR) / "../shared/data/lego";
    if (!fs::exists(lego)) GTEST_SKIP() << "no lego scene at " << lego;
    const Scene scene = Scene::load(lego);
    EXPECT_EQ(scene.name(), "lego");
    EXPECT_EQ(scene.views("train").size(), 100u);
    EXPECT_EQ(scene.views("val").size(), 10u);
    EXPECT_EQ(scene.views("test").size(), 25u);
    EXPECT_TRUE(scene.has_alpha());
    EXPECT_FALSE(scene.forward_facing());
    EXPECT_NEAR(scene.radius_range()[0], 4.03, 0.15);
    EXPECT_NEAR(scene.views()[0].camera.fx, 555.5555, 1e-3);
    const Tensor image = scene.image(scene.views("test")[3]);
    EXPECT_EQ(image.sizes(), at::IntArrayRef({400, 400, 4}));
    const float covered = image.select(2, 3).mean().item<float>();
    EXPECT_GT(covered, 0.1f);
    EXPECT_LT(covered, 0.6f);
}

}  // namespace
}  // namespace fieldgraft
