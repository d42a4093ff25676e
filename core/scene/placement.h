// Where a scene's model coordinates lie: the rules that scene.h states, as functions of cameras in the file's own
// world.
#pragma once

#include "core/scene/scene.h"
#include "core/scene/transforms_file.h"

namespace fieldgraft {

struct Placement {
    Frame file_to_model;
    Bounds box;  // model coordinates
};

// Throws InputError if a dataparser_transforms.json beside the file is broken.
Placement place_scene(const TransformsFile& file, const std::vector<Camera>& cameras, bool has_alpha);

// The median over cameras of distance · tan(half the wider angle of view): the radius around `focus` that a view just
// holds.
double visible_radius(const std::vector<Camera>& cameras, const Vec3& focus);
// The least rotation (row-major) that takes direction a to direction b.
std::array<double, 9> rotation_between(const Vec3& a, const Vec3& b);
// The smallest box around the image of `box` under `frame`.
Bounds mapped_box(const Bounds& box, const Frame& frame);

}  // namespace fieldgraft
