// The frame of a scene: the similarity that takes the user's world to model coordinates,
//
//     x_model = M·[x_world; 1] = s·(R·x_world + t),
//
// with M 3×4 row-major, R a proper rotation, s > 0. Every export applies the inverse: without it a volume comes back at
// the wrong place, turned and scaled. JSON has the form of nerfstudio's dataparser_transforms.json, {"transform":
// [R|t], "scale": s}. A round trip through inverse() is exact to a few units of double rounding.
#pragma once

#include "core/base/json.h"
#include "core/scene/linear.h"

namespace fieldgraft {

struct Frame {
    std::array<double, 12> matrix{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

    // s·(R·x + t). Throws std::invalid_argument unless s > 0 and R (9 values, row-major) is a proper rotation (to
    // 1e-4).
    static Frame make(double scale, const std::array<double, 9>& rotation, const Vec3& translation);
    static Frame from_matrix(const std::array<double, 12>& matrix);
    // Throws InputError, naming `where`, if the JSON is not a similarity.
    static Frame from_json(const Json& json, const std::string& where);
    Json to_json() const;

    double scale() const;
    Frame inverse() const;
    Vec3 point(const Vec3& world) const;
    // A camera keeps orthonormal axes: its position is mapped, its axes are only rotated.
    Mat4 pose(const Mat4& camera_to_world) const;
    bool operator==(const Frame&) const = default;
};

// first, then second: (second ∘ first).
Frame compose(const Frame& second, const Frame& first);

}  // namespace fieldgraft
