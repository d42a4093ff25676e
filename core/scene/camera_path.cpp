#include "core/scene/camera_path.h"

#include <numbers>
#include <sstream>

#include "core/base/errors.h"
#include "core/base/json.h"
#include "core/scene/transforms_file.h"

namespace fieldgraft {
namespace fs = std::filesystem;

namespace {

constexpr double degree = std::numbers::pi / 180;

std::vector<double> sixteen(const Json& value, const std::string& where) {
    std::vector<double> numbers;
    if (value.is_array()) {
        for (const Json& number : value)
            if (number.is_number()) numbers.push_back(number.get<double>());
        if (numbers.size() != value.size()) numbers.clear();
    } else if (value.is_string()) {
        std::string text = value.get<std::string>();
        for (char& c : text)
            if (c == '[' || c == ']' || c == ',') c = ' ';
        std::istringstream in(text);
        for (double number; in >> number;) numbers.push_back(number);
        if (!in.eof()) numbers.clear();
    }
    if (numbers.size() != 16) input_error("{}: not a matrix of 16 numbers", where);
    return numbers;
}

// A flat list is row-major; the string form of nerfstudio's Blender add-on is column-major.
Mat4 read_matrix(const Json& value, const std::string& where, std::vector<std::string>& warnings) {
    const std::vector<double> numbers = sixteen(value, where);
    Json rows = Json::array();
    for (int i = 0; i < 4; ++i) {
        rows.push_back(Json::array());
        for (int j = 0; j < 4; ++j) rows[i].push_back(numbers[value.is_string() ? 4 * j + i : 4 * i + j]);
    }
    return read_pose(rows, where, warnings);
}

double number(const Json& json, const char* key, double low, double high, const std::string& where) {
    const auto found = json.find(key);
    if (found == json.end()) input_error("{}: no \"{}\"", where, key);
    const double value = found->is_number() ? found->get<double>() : std::nan("");
    if (!(value > low && value < high))
        input_error("{}: \"{}\" is {}; more than {} and less than {} is needed", where, key, found->dump(), low, high);
    return value;
}

Camera camera_from_fov(int width, int height, double fov, const Mat4& pose, const std::string& name) {
    Camera camera;
    camera.name = name;
    camera.width = width;
    camera.height = height;
    camera.fx = camera.fy = 0.5 * height / std::tan(0.5 * fov * degree);
    camera.cx = 0.5 * width;
    camera.cy = 0.5 * height;
    camera.camera_to_world = pose;
    return camera;
}

double vertical_fov(const Camera& camera) {
    return 2 * std::atan(0.5 * camera.height / camera.fy) / degree;
}

void check_writable(const std::vector<Camera>& cameras) {
    if (cameras.empty()) throw std::invalid_argument("write_camera_path: no cameras");
    for (const Camera& c : cameras) {
        check_camera(c);
        const bool centred = std::abs(c.cx - 0.5 * c.width) < 1e-3 && std::abs(c.cy - 0.5 * c.height) < 1e-3;
        if (c.width != cameras[0].width || c.height != cameras[0].height || std::abs(c.fx / c.fy - 1) > 1e-6 ||
            !centred || c.lens != Lens::pinhole)
            throw std::invalid_argument(
                fmt::format("write_camera_path: camera '{}' differs in size, or has no square pixels, centred "
                            "principal point or pinhole "
                            "lens; the format cannot say that",
                            c.name));
    }
}

}  // namespace

CameraPath read_camera_path(const fs::path& path) {
    const Json file = read_json(path);
    const std::string where = path.string();
    const auto has_list = [&](const char* key) {
        return file.contains(key) && file[key].is_array() && !file[key].empty();
    };
    if (!file.is_object() || (!has_list("camera_path") && !has_list("keyframes")))
        input_error("{}: no \"camera_path\" and no \"keyframes\" with entries; a nerfstudio camera path is needed",
                    where);
    if (const std::string type = file.value("camera_type", Json("perspective")).dump(); type != "\"perspective\"")
        input_error("{}: camera_type {} is not supported; \"perspective\" is", where, type);
    const int width = static_cast<int>(number(file, "render_width", 0.5, 65536, where));
    const int height = static_cast<int>(number(file, "render_height", 0.5, 65536, where));
    const bool keyframes = !has_list("camera_path");
    const char* list = keyframes ? "keyframes" : "camera_path";
    const char* matrix = keyframes ? "matrix" : "camera_to_world";
    CameraPath result;
    if (file.contains("fps")) result.fps = number(file, "fps", 0, 1e6, where);
    if (file.contains("seconds")) result.seconds = number(file, "seconds", -1e-9, 1e9, where);
    std::vector<std::string> warnings;
    for (std::size_t i = 0; i < file[list].size(); ++i) {
        const Json& entry = file[list][i];
        const std::string here = fmt::format("{} {}[{}]", where, list, i);
        if (!entry.is_object() || !entry.contains(matrix)) input_error("{}: no \"{}\"", here, matrix);
        const Json& source = entry.contains("fov") || !file.contains("default_fov") ? entry : file;
        const double fov = number(source,
                                  entry.contains("fov") ? "fov"
                                  : &source == &file    ? "default_fov"
                                                        : "fov",
                                  0, 180, here);
        const Mat4 pose = read_matrix(entry[matrix], here, warnings);
        result.cameras.push_back(camera_from_fov(width, height, fov, pose, fmt::format("{:05}", i)));
    }
    return result;
}

void write_camera_path(const fs::path& path, const std::vector<Camera>& cameras, double fps) {
    check_writable(cameras);
    if (!(fps > 0)) throw std::invalid_argument(fmt::format("write_camera_path: fps {} is not > 0", fps));
    const Camera& first = cameras.front();
    const double aspect = static_cast<double>(first.width) / first.height;
    Json entries = Json::array(), keyframes = Json::array();
    for (const Camera& camera : cameras) {
        const double fov = vertical_fov(camera);
        entries.push_back({{"camera_to_world", camera.camera_to_world}, {"fov", fov}, {"aspect", aspect}});
        keyframes.push_back({{"matrix", camera.camera_to_world},
                             {"fov", fov},
                             {"aspect", aspect},
                             {"override_transition_enabled", false},
                             {"override_transition_sec", nullptr}});
    }
    write_json(path, {{"keyframes", keyframes},
                      {"camera_type", "perspective"},
                      {"render_height", first.height},
                      {"render_width", first.width},
                      {"fps", fps},
                      {"seconds", static_cast<double>(cameras.size()) / fps},
                      {"is_cycle", false},
                      {"smoothness_value", 0.0},
                      {"camera_path", entries},
                      {"default_fov", vertical_fov(first)},
                      {"default_transition_sec", 1.0 / fps}});
}

}  // namespace fieldgraft
