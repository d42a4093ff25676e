// Where a field lives: what `edit` and `bake` need to know of the scene once its images are gone.
//
// Everything is in *model* coordinates (the coordinates the field was trained in). `frame` is the 3×4 row-major
// similarity user world → model, x_model = frame · [x_world; 1]; exports apply its inverse. Density is per model unit
// of length, so a density in the user's world is density · scale(frame).
#pragma once

#include <algorithm>
#include <array>

#include "core/base/json.h"

namespace fieldgraft {

// The unit cube's scale: a box's corner goes to 0 and its longest edge to 1.
inline double longest_edge(const std::array<double, 3>& box_min, const std::array<double, 3>& box_max) {
    return std::max({box_max[0] - box_min[0], box_max[1] - box_min[1], box_max[2] - box_min[2]});
}

struct FieldGeometry {
    std::array<double, 3> box_min{-1.5, -1.5, -1.5};  // the box outside which density is 0, model coordinates
    std::array<double, 3> box_max{1.5, 1.5, 1.5};
    std::array<double, 12> frame{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    std::array<double, 3> up{0, 0, 1};                // model coordinates
    std::array<double, 3> centre{0, 0, 0};            // what the cameras look at
    std::array<double, 2> radius_range{3.5, 4.5};     // distance of the training cameras from `centre`
    int image_width = 400, image_height = 400;        // a typical training camera
    double focal_x = 555.0, focal_y = 555.0;          // pixels
    double principal_x = 200.0, principal_y = 200.0;  // pixels
    bool white_background = true;                     // images with alpha: trained over random, shown over white
    std::array<double, 3> background{1, 1, 1};        // what the scene's pictures show where nothing is
    bool forward_facing = false;                      // cameras on one side only: never sample the hemisphere

    Json to_json() const;
    static FieldGeometry from_json(const Json& json);
};

inline double longest_edge(const FieldGeometry& geometry) {
    return longest_edge(geometry.box_min, geometry.box_max);
}

}  // namespace fieldgraft
