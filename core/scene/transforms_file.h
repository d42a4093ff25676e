// One transforms*.json file, checked and turned into cameras in the file's own world. Three dialects share the form:
// NeRF-synthetic (camera_angle_x only), nerfstudio (fl_x …), instant-ngp (x_fov, aabb_scale, scale, offset).
//
// Focal length, per axis, a frame's own keys before the file's: x_fov (degrees) > fl_x > camera_angle_x (radians); an
// axis without any takes the other's (square pixels). Poses: 4×4 (or 3×4) camera-to-world, OpenGL axes, rotation times
// at most a uniform scale, which is divided out with a warning; everything else is refused.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/base/json.h"
#include "core/scene/camera.h"

namespace fieldgraft {

enum class Dialect { synthetic, nerfstudio, ngp };

struct FileFrame {
    std::string file_path;  // as the file writes it
    std::filesystem::path image, mask;
    Camera camera;
    std::string split;  // empty until someone knows
    bool has_alpha = false;
};

struct NgpBox {
    double aabb_scale = 1, scale = 0.33;
    Vec3 offset{0.5, 0.5, 0.5};
};

struct TransformsFile {
    std::filesystem::path path;
    Dialect dialect = Dialect::synthetic;
    std::vector<FileFrame> frames;  // sorted by file name, except in the synthetic dialect
    Frame applied;                  // original world → the file's: applied_transform, then applied_scale
    double applied_scale = 1;
    bool keep_orientation = false;  // orientation_override "none"
    std::optional<NgpBox> ngp_box;
    bool has_splits = false;  // it had {train,val,test}_filenames
    std::vector<std::string> warnings;
};

// `needed(split)`: whether frames of that split must be complete (a frame that is not needed is left out when its image
// is missing or wrong). `split` is what the file's name says, empty for a single file. Throws InputError.
TransformsFile read_transforms(const std::filesystem::path& path, const std::string& split,
                               const std::function<bool(const std::string&)>& needed);

// A checked pose out of 4×4 or 3×4 JSON rows; `where` for messages; adds to `warnings` if a scale was divided out.
Mat4 read_pose(const Json& rows, const std::string& where, std::vector<std::string>& warnings);

}  // namespace fieldgraft
