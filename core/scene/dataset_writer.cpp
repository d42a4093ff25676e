#include "core/scene/dataset_writer.h"

#include "core/base/errors.h"
#include "core/base/json.h"

namespace fieldgraft {
namespace fs = std::filesystem;

namespace {

Json matrix_rows(const Mat4& m) {
    Json rows = Json::array();
    for (int i = 0; i < 4; ++i) rows.push_back({m[4 * i], m[4 * i + 1], m[4 * i + 2], m[4 * i + 3]});
    return rows;
}

double angle_x(const Camera& camera) {
    return 2 * std::atan(0.5 * camera.width / camera.fx);
}

}  // namespace

void write_nerf_synthetic(const fs::path& folder, const std::string& split, const std::vector<Camera>& cameras) {
    if (cameras.empty()) throw std::invalid_argument("write_nerf_synthetic: no cameras");
    Json frames = Json::array();
    for (const Camera& c : cameras) {
        check_camera(c);
        const bool centred = std::abs(c.cx - 0.5 * c.width) < 1e-3 && std::abs(c.cy - 0.5 * c.height) < 1e-3;
        if (!centred || c.lens != Lens::pinhole || std::abs(c.fx / c.fy - 1) > 1e-6 ||
            std::abs(angle_x(c) - angle_x(cameras[0])) > 1e-9)
            throw std::invalid_argument(
                fmt::format("write_nerf_synthetic: camera '{}' needs square pixels, a centred principal point, no "
                            "distortion and the "
                            "angle of the others; write_nerfstudio can say the rest",
                            c.name));
        frames.push_back(
            {{"file_path", "./" + split + "/" + c.name}, {"transform_matrix", matrix_rows(c.camera_to_world)}});
    }
    write_json(folder / ("transforms_" + split + ".json"),
               {{"camera_angle_x", angle_x(cameras[0])}, {"frames", frames}});
}

void write_nerfstudio(const fs::path& folder, const std::vector<Camera>& cameras, const std::string& images) {
    if (cameras.empty()) throw std::invalid_argument("write_nerfstudio: no cameras");
    Json frames = Json::array();
    for (const Camera& c : cameras) {
        check_camera(c);
        Json frame = {{"file_path", images + "/" + c.name + ".png"},
                      {"transform_matrix", matrix_rows(c.camera_to_world)},
                      {"w", c.width},
                      {"h", c.height},
                      {"fl_x", c.fx},
                      {"fl_y", c.fy},
                      {"cx", c.cx},
                      {"cy", c.cy}};
        if (c.lens != Lens::pinhole) {
            const Distortion& d = c.distortion;
            frame.update({{"k1", d.k1}, {"k2", d.k2}, {"k3", d.k3}, {"k4", d.k4}, {"p1", d.p1}, {"p2", d.p2}});
            frame["camera_model"] = c.lens == Lens::fisheye ? "OPENCV_FISHEYE" : "OPENCV";
        }
        frames.push_back(frame);
    }
    write_json(folder / "transforms.json", {{"frames", frames}});
}

}  // namespace fieldgraft
