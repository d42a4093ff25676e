// nerfstudio's camera_path.json. Written in the viewer's form; read in that form and in the one of nerfstudio's own
// Blender add-on (keyframes whose `matrix` is a string of 16 numbers, column-major).
//
// fov is vertical, in degrees; the frame of the matrices is the file's own: a caller whose cameras are in the user's
// world maps them with transformed(camera, scene.frame()). Square pixels, principal point at the centre.
#pragma once

#include <filesystem>
#include <vector>

#include "core/scene/camera.h"

namespace fieldgraft {

struct CameraPath {
    std::vector<Camera> cameras;  // named by their number, 00000, 00001, …
    double fps = 24, seconds = 0;
};

// Throws InputError. Without `camera_path` entries the keyframes are the cameras.
CameraPath read_camera_path(const std::filesystem::path& path);
// All cameras must have one size and square pixels; lens distortion cannot be said in this format
// (std::invalid_argument).
void write_camera_path(const std::filesystem::path& path, const std::vector<Camera>& cameras, double fps = 24);

}  // namespace fieldgraft
