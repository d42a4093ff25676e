// Small scenes written into a temporary folder.
#pragma once

#include <numbers>

#include "core/base/image.h"
#include "core/base/json.h"
#include "core/scene/camera.h"
#include "tests/base/temp_folder.h"

namespace fieldgraft {

inline Json rows_of(const Mat4& m) {
    Json rows = Json::array();
    for (int i = 0; i < 4; ++i) rows.push_back({m[4 * i], m[4 * i + 1], m[4 * i + 2], m[4 * i + 3]});
    return rows;
}

// Camera i of n on a ring 30° above the ground, looking at the centre.
inline Mat4 ring_pose(int i, int n, double radius = 4, const Vec3& centre = {0, 0, 0}) {
    const double azimuth = 2 * std::numbers::pi * i / n;
    const Vec3 offset{radius * 0.866 * std::cos(azimuth), radius * 0.866 * std::sin(azimuth), 0.5 * radius};
    return look_at(centre + offset, centre, {0, 0, 1});
}

inline void write_plain_image(const std::filesystem::path& path, int width = 12, int height = 8, int channels = 4,
                              float value = 0.5f) {
    write_png(path, at::full({height, width, channels}, value));
}

// n frames train/r_0 … with images of 12×8 RGBA, and the file's JSON, not yet written.
inline Json synthetic_split(const std::filesystem::path& folder, const std::string& split, int n) {
    Json file = {{"camera_angle_x", 0.8}, {"frames", Json::array()}};
    for (int i = 0; i < n; ++i) {
        const std::string name = split + "/r_" + std::to_string(i);
        write_plain_image(folder / (name + ".png"));
        file["frames"].push_back(
            {{"file_path", "./" + name}, {"rotation", 0.1}, {"transform_matrix", rows_of(ring_pose(i, n))}});
    }
    return file;
}

// A nerfstudio file of n frames images/000i.png around `centre`.
inline Json nerfstudio_file(const std::filesystem::path& folder, int n, const Vec3& centre = {5, -2, 1},
                            int channels = 3) {
    Json file = {{"w", 12},   {"h", 8},    {"fl_x", 10.0},           {"fl_y", 11.0},
                 {"cx", 6.5}, {"cy", 4.0}, {"frames", Json::array()}};
    for (int i = n - 1; i >= 0; --i) {  // backwards: the reader sorts
        const std::string name = "images/" + std::to_string(1000 + i) + ".png";
        write_plain_image(folder / name, 12, 8, channels);
        file["frames"].push_back({{"file_path", name}, {"transform_matrix", rows_of(ring_pose(i, n, 8, centre))}});
    }
    return file;
}

}  // namespace fieldgraft
