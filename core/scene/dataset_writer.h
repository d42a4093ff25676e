// Camera files of a data set. Images are not written here: frame i's is `folder/IMAGE(camera name)`, as given.
#pragma once

#include <filesystem>
#include <vector>

#include "core/scene/camera.h"

namespace fieldgraft {

// NeRF-synthetic: folder/transforms_SPLIT.json with file_path "./SPLIT/NAME" (the images are SPLIT/NAME.png). All
// cameras share one horizontal angle, square pixels, a centred principal point and no distortion, or
// std::invalid_argument.
void write_nerf_synthetic(const std::filesystem::path& folder, const std::string& split,
                          const std::vector<Camera>& cameras);
// nerfstudio: folder/transforms.json, intrinsics by frame, file_path "IMAGES/NAME.png".
void write_nerfstudio(const std::filesystem::path& folder, const std::vector<Camera>& cameras,
                      const std::string& images = "images");

}  // namespace fieldgraft
