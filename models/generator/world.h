// A scene with its geometry: primitives, paints and objects in world coordinates (z up, the ground at z = 0), and the
// view: camera, lights and the picture's own faults. Built from a SceneSpec; everything random comes from the seeds
// that the spec carries. Colours here are linear (the square of the encoded pixel).
#pragma once

#include <cstdint>
#include <vector>

#include "models/generator/primitives.h"
#include "models/generator/settings.h"
#include "models/generator/spec.h"
#include "models/generator/vocabulary.h"

namespace fieldgraft::generator {

struct Paint {
    int material = 0;
    int colour = -1;  // the word, −1 where the material brings its own
    bool ground_stuff = false;
    Vec3 base{0.5f, 0.5f, 0.5f}, second{1, 1, 1};
    float scale = 4.0f;   // texture periods per object unit
    float amount = 0.5f;  // cover of rust, moss, snow, fire
    float gloss = 0.3f;
    int axis = 2;  // of stripes and grain
    Vec3 offset;   // into the noise
};

struct WorldObject {
    Role role = Role::kMain;
    bool ground = false;
    int shape = -1, material = 0, colour = -1;
    Vec3 position;
    Mat3 rotation;
    float size = 1.0f;
    Vec3 half;  // rotated bounding box in world axes, before the size
};

struct World {
    std::vector<Primitive> primitives;
    std::vector<Paint> paints;
    std::vector<WorldObject> objects;
    Vec3 low, high;  // bounds of what the caption speaks of
};

struct View {
    Vec3 eye;
    Mat3 axes;  // right, up, forward
    float tangent = 0.4f;
    float shift_x = 0.0f, shift_y = 0.0f;
    Vec3 key_direction, key, fill_direction, fill, ambient, sky, horizon;
    bool shadows = true;
    float exposure = 1.0f, blur = 0.0f, grain = 0.0f;
    uint64_t grain_seed = 0;
};

World build_world(const SceneSpec& spec);
// `low` and `high` bound what has to be seen.
View make_view(uint64_t seed, const Settings& settings, Vec3 low, Vec3 high);
// Half-extents of an object's bounding box at size 1 and where a hat sits: what placing needs.
struct Footprint {
    Vec3 half;
    Vec3 anchor;
    float anchor_width;
};
Footprint footprint(const ObjectSpec& object);

}  // namespace fieldgraft::generator
