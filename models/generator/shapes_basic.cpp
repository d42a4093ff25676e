// Cube, ball, cone, cylinder, ring, pyramid.
#include "models/generator/shapes.h"

namespace fieldgraft::generator {
namespace {

void build_cube(Builder& b) {
    const float s = b.rng.uniform(0.9f, 1.1f);
    b.box(kBody, {0, 0, 1}, {s, b.rng.uniform(0.9f, 1.1f), 1});
}

void build_ball(Builder& b) {
    b.ball(kBody, {0, 0, 1}, 1.0f);
}

void build_cone(Builder& b) {
    const float h = b.rng.uniform(1.4f, 2.6f);
    b.rod(kBody, {0, 0, 0}, {0, 0, h}, 1.0f, b.rng.chance(0.2f) ? 0.12f : 0.01f);
}

void build_cylinder(Builder& b) {
    b.rod(kBody, {0, 0, 0}, {0, 0, b.rng.uniform(1.3f, 2.8f)}, 0.8f);
}

void build_ring(Builder& b) {
    const float minor = b.rng.uniform(0.16f, 0.4f);
    const bool upright = b.rng.chance(0.4f);
    const Vec3 axis = upright ? normalized({1, b.rng.uniform(-1, 1), 0.2f}) : Vec3{0, 0, 1};
    b.ring(kBody, {0, 0, 1}, axis, 1.0f, minor);
}

void build_pyramid(Builder& b) {
    b.pyramid(kBody, {0, 0, 0}, {1, 1, b.rng.uniform(0.65f, 1.1f)});
}

}  // namespace

std::vector<ShapeInfo> basic_shapes() {
    std::vector<ShapeInfo> list = {
        {"cube", "cubes", {"box", "block"}, {}, build_cube},
        {"ball", "balls", {"sphere"}, {}, build_ball},
        {"cone", "cones", {}, {}, build_cone},
        {"cylinder", "cylinders", {}, {}, build_cylinder},
        {"ring", "rings", {"torus", "donut"}, {}, build_ring},
        {"pyramid", "pyramids", {}, {}, build_pyramid},
    };
    for (ShapeInfo& s : list) s.tumbles = s.name != "pyramid" && s.name != "ball";
    for (const size_t pointed : {size_t{1}, size_t{2}, size_t{4}, size_t{5}}) list[pointed].holds = pointed == 1;
    return list;
}

}  // namespace fieldgraft::generator
