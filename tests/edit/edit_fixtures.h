// A small field, a scene that looks at it and a tiny random guide, for the tests of the edit room.
#pragma once

#include "core/base/image.h"
#include "core/edit/edit_loop.h"
#include "tests/guidance/tiny_model.h"

namespace fieldgraft {

// A random field whose matter is the ball of radius 0.8 in the box ±1.5.
inline std::shared_ptr<RadianceField> small_field() {
    FieldGeometry geometry;
    geometry.image_width = geometry.image_height = 48;
    geometry.focal_x = geometry.focal_y = 60;
    geometry.principal_x = geometry.principal_y = 24;
    geometry.radius_range = {3.8, 4.2};
    HashFieldConfig config;
    config.levels = 4;
    config.log2_table_size = 12;
    config.finest_resolution = 64;
    auto field = std::make_shared<RadianceField>(config, geometry, 3);
    const int resolution = 32;
    const Tensor axis = (at::arange(resolution, at::kFloat) + 0.5) * (3.0 / resolution) - 1.5;
    const auto zyx = at::meshgrid({axis, axis, axis}, "ij");
    const Tensor radius = (zyx[0].square() + zyx[1].square() + zyx[2].square()).sqrt();
    field->set_occupancy((radius < 0.8).to(at::kByte));
    field->freeze();
    // Dense enough to be opaque: constant features, log density 3; the colours stay random.
    at::NoGradGuard no_gradients;
    const auto set = [&](const char* name, double value) { Tensor(field->parameters().at(name)).fill_(value); };
    set("encoding.table", 1);
    set("density.0", 1.0 / (config.levels * config.features_per_level));
    Tensor(field->parameters().at("density.1"))[0].fill_(3.0 / config.density_hidden);
    return field;
}

// Four cameras around the ball, 48×48.
inline std::vector<Camera> small_cameras() {
    std::vector<Camera> cameras;
    for (int i = 0; i < 4; ++i) {
        Camera camera;
        camera.name = "view_" + std::to_string(i);
        camera.width = camera.height = 48;
        camera.fx = camera.fy = 60;
        camera.cx = camera.cy = 24;
        const double angle = 1.5707963 * i;
        camera.camera_to_world = look_at({3.7 * std::cos(angle), 3.7 * std::sin(angle), 1.5}, {0, 0, 0}, {0, 0, 1});
        cameras.push_back(camera);
    }
    return cameras;
}

inline Scene small_scene() {
    return Scene::from_images(small_cameras(), std::vector<Tensor>(4, at::ones({48, 48, 3})));
}

// Masks of the views: the upper half of the picture. Returns the specification's entries.
inline std::vector<UserMask> upper_half_masks(const std::filesystem::path& folder) {
    Tensor mask = at::zeros({48, 48});
    mask.slice(0, 0, 24).fill_(1);
    std::vector<UserMask> masks;
    for (int i = 0; i < 4; ++i) {
        masks.push_back({"view_" + std::to_string(i), (folder / fmt::format("mask_{}.png", i)).string()});
        write_png(masks.back().file, mask);
    }
    return masks;
}

// A quick edit of the ball's upper half by masks alone.
inline EditSpec small_spec(const std::string& operations, const std::filesystem::path& folder) {
    EditSpec spec = EditSpec::from_preset("builtin", Operations::parse(operations));
    spec.source = "ball";
    spec.target = "red ball";
    spec.region_source = RegionSource::masks;
    spec.masks = upper_half_masks(folder);
    spec.set_weight("inside", 1);
    spec.patch = 24;
    spec.augmentations = 2;
    spec.camera_pool = 3;
    spec.iterations = 12;
    spec.dilation = 1;
    spec.seed = 5;
    return spec;
}

struct SmallWorld {
    TemporaryFolder folder;
    Scene scene = small_scene();
    EditInputs inputs;

    SmallWorld() {
        TinyModel model;
        model.config["templates"] = {"{}", "a {}"};  // ten tokens hold no longer ones
        model.write(folder.path());
        inputs.field = small_field();
        inputs.guide = Guidance::load(folder.path());
        inputs.scene = &scene;
    }
};

}  // namespace fieldgraft
