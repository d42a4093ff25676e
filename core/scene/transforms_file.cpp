#include "core/scene/transforms_file.h"

#include <algorithm>
#include <map>
#include <numbers>

#include "core/base/errors.h"
#include "core/base/image.h"
#include "core/scene/image_paths.h"

namespace fieldgraft {
namespace fs = std::filesystem;

namespace {

// A frame's keys before the file's.
struct Keys {
    const Json& frame;
    const Json& file;
    std::string where;

    const Json* find(const char* key) const {
        for (const Json* level : {&frame, &file})
            if (const auto found = level->find(key); found != level->end() && !found->is_null()) return &*found;
        return nullptr;
    }
    std::optional<double> number(const char* key) const {
        const Json* value = find(key);
        if (value == nullptr) return std::nullopt;
        if (!value->is_number() || !std::isfinite(value->get<double>()))
            input_error("{}: \"{}\" is {}; a finite number is needed", where, key, value->dump());
        return value->get<double>();
    }
    std::optional<double> between(const char* key, double low, double high) const {
        const auto value = number(key);
        if (value && !(*value > low && *value < high))
            input_error("{}: \"{}\" is {}; more than {} and less than {} is needed", where, key, *value, low, high);
        return value;
    }
};

// Precedence within one level, so that a frame's fl_x beats the file's x_fov.
std::optional<double> focal(const Keys& keys, const std::string& axis, int size) {
    const std::string fov = axis + "_fov", length = "fl_" + axis, angle = "camera_angle_" + axis;
    const Json none = Json::object();
    for (const Json* level : {&keys.frame, &keys.file}) {
        const Keys here{*level, none, keys.where};
        if (const auto value = here.between(fov.c_str(), 0, 180))
            return 0.5 * size / std::tan(0.5 * *value * std::numbers::pi / 180);
        if (const auto value = here.between(length.c_str(), 0, 1e9)) return value;
        if (const auto value = here.between(angle.c_str(), 0, std::numbers::pi))
            return 0.5 * size / std::tan(0.5 * *value);
    }
    return std::nullopt;
}

void read_lens(const Keys& keys, Camera& camera) {
    Distortion& d = camera.distortion;
    const std::array<std::pair<const char*, double*>, 6> terms = {
        {{"k1", &d.k1}, {"k2", &d.k2}, {"k3", &d.k3}, {"k4", &d.k4}, {"p1", &d.p1}, {"p2", &d.p2}}};
    for (const auto& [key, term] : terms) *term = keys.number(key).value_or(0.0);
    const Json* model = keys.find("camera_model");
    const std::string name = model == nullptr ? "" : model->is_string() ? model->get<std::string>() : model->dump();
    const Json* fisheye = keys.find("is_fisheye");
    constexpr std::array known = {"", "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV"};
    if (name == "OPENCV_FISHEYE" || (fisheye != nullptr && *fisheye == true)) {
        camera.lens = Lens::fisheye;
    } else if (std::find(known.begin(), known.end(), name) != known.end()) {
        camera.lens = d == Distortion{} ? Lens::pinhole : Lens::opencv;
    } else {
        input_error(
            "{}: camera_model {} is not supported; PINHOLE, OPENCV and OPENCV_FISHEYE are (undistort the images)",
            keys.where, name);
    }
}

void read_intrinsics(const Keys& keys, Camera& camera, const fs::path& image) {
    const auto check = [&](const char* key, int actual) {
        const auto said = keys.number(key);
        if (said && std::lround(*said) != actual)
            input_error("{}: {} is {}×{} pixels, but the file says {} = {}; scale the images or mend the file",
                        keys.where, image.string(), camera.width, camera.height, key, *said);
    };
    check("w", camera.width);
    check("h", camera.height);
    const auto fx = focal(keys, "x", camera.width), fy = focal(keys, "y", camera.height);
    if (!fx && !fy)
        input_error(
            "{}: no focal length; \"camera_angle_x\" (radians), \"fl_x\" (pixels) or \"x_fov\" (degrees) is needed",
            keys.where);
    camera.fx = fx ? *fx : *fy;
    camera.fy = fy ? *fy : *fx;
    camera.cx = keys.number("cx").value_or(0.5 * camera.width);
    camera.cy = keys.number("cy").value_or(0.5 * camera.height);
    read_lens(keys, camera);
}

void read_mask(const Keys& keys, const fs::path& folder, FileFrame& frame) {
    const auto mask = keys.frame.find("mask_path");
    if (mask == keys.frame.end() || mask->is_null()) return;
    if (!mask->is_string()) input_error("{}: mask_path is {}; a file path is needed", keys.where, mask->dump());
    frame.mask = find_image(folder, mask->get<std::string>(), keys.where + " mask").path;
    const auto size = image_size(frame.mask);
    if (size[0] != frame.camera.height || size[1] != frame.camera.width)
        input_error("{}: the mask {} is {}×{} pixels, the image {}×{}; they must agree", keys.where,
                    frame.mask.string(), size[1], size[0], frame.camera.width, frame.camera.height);
}

FileFrame read_frame(const Json& json, const Json& file, const fs::path& path, std::size_t index,
                     std::vector<std::string>& warnings) {
    std::string where = fmt::format("{} frame {}", path.string(), index);
    if (!json.is_object()) input_error("{}: not an object with file_path and transform_matrix", where);
    if (!json.contains("file_path") || !json["file_path"].is_string())
        input_error("{}: no \"file_path\"; the image's path is needed", where);
    FileFrame frame;
    frame.file_path = json["file_path"];
    where += fmt::format(" ({})", frame.file_path);
    if (!json.contains("transform_matrix"))
        input_error("{}: no \"transform_matrix\"; the 4×4 camera-to-world matrix is needed", where);
    frame.camera.camera_to_world = read_pose(json["transform_matrix"], where, warnings);
    const FoundImage found = find_image(path.parent_path(), frame.file_path, where);
    frame.image = found.path;
    if (found.guessed)
        warnings.push_back(fmt::format("{}: no such image; {} was taken for it", where, found.path.string()));
    const auto size = image_size(frame.image);
    frame.camera.height = size[0];
    frame.camera.width = size[1];
    frame.has_alpha = size[2] == 4;
    frame.camera.name = frame.image.stem().string();
    const Keys keys{json, file, where};
    read_intrinsics(keys, frame.camera, frame.image);
    read_mask(keys, path.parent_path(), frame);
    return frame;
}

Dialect dialect_of(const Json& file) {
    const Json& first = file["frames"][0];
    const auto any = [&](std::initializer_list<const char*> keys) {
        return std::any_of(keys.begin(), keys.end(), [&](const char* key) {
            return file.contains(key) || (first.is_object() && first.contains(key));
        });
    };
    if (any({"aabb_scale", "x_fov", "y_fov", "scale", "offset", "is_fisheye"})) return Dialect::ngp;
    if (any({"fl_x", "fl_y", "camera_model", "applied_transform", "train_filenames"})) return Dialect::nerfstudio;
    return Dialect::synthetic;
}

void read_world(const Json& file, TransformsFile& result) {
    const std::string where = result.path.string();
    const Json none = Json::object();
    const Keys keys{none, file, where};
    if (const Json* transform = keys.find("applied_transform"))
        result.applied = Frame::from_json({{"transform", *transform}}, where + " applied_transform");
    result.applied_scale = keys.between("applied_scale", 0, 1e12).value_or(1.0);
    for (double& value : result.applied.matrix) value *= result.applied_scale;
    const Json* orientation = keys.find("orientation_override");
    result.keep_orientation = orientation != nullptr && *orientation == "none";
    if (result.dialect != Dialect::ngp) return;
    NgpBox box;
    box.aabb_scale = keys.between("aabb_scale", 0, 1e6).value_or(1.0);
    box.scale = keys.between("scale", 0, 1e6).value_or(box.scale);
    if (const Json* offset = keys.find("offset")) {
        if (!offset->is_array() || offset->size() != 3 ||
            !std::all_of(offset->begin(), offset->end(), [](const Json& v) { return v.is_number(); }))
            input_error("{}: \"offset\" is {}; 3 numbers are needed", where, offset->dump());
        for (int i = 0; i < 3; ++i) box.offset[i] = (*offset)[i];
    }
    result.ngp_box = box;
}

// file name → split, from the {train,val,test}_filenames lists. A file in several lists: train, then test, then val.
std::map<std::string, std::string> read_split_lists(const Json& file, TransformsFile& result) {
    std::map<std::string, std::string> splits;
    for (const std::string split : {"train", "test", "val"}) {
        const auto list = file.find(split + "_filenames");
        if (list == file.end() || list->is_null()) continue;
        if (!list->is_array()) input_error("{}: \"{}_filenames\" is not a list", result.path.string(), split);
        result.has_splits = true;
        for (const Json& name : *list) {
            if (!name.is_string())
                input_error("{}: \"{}_filenames\" holds {}", result.path.string(), split, name.dump());
            const std::string where = result.path.string() + " " + split + "_filenames";
            splits.emplace(checked_relative(name.get<std::string>(), where).string(), split);
        }
    }
    return splits;
}

void check_lists_used(const std::map<std::string, std::string>& splits, const Json& frames, const fs::path& path) {
    for (const auto& [name, split] : splits) {
        const bool used = std::any_of(frames.begin(), frames.end(), [&, &name = name](const Json& frame) {
            return frame.is_object() && frame.contains("file_path") && frame["file_path"].is_string() &&
                   checked_relative(frame["file_path"].get<std::string>(), path.string()).string() == name;
        });
        if (!used)
            input_error("{}: {}_filenames names '{}', but no frame has that file_path", path.string(), split, name);
    }
}

void every_eighth_to_test(std::vector<FileFrame>& frames) {
    for (std::size_t i = 0; i < frames.size(); ++i)
        frames[i].split = frames.size() >= 8 && i % 8 == 0 ? "test" : "train";
}

}  // namespace

TransformsFile read_transforms(const fs::path& path, const std::string& split,
                               const std::function<bool(const std::string&)>& needed) {
    const Json file = read_json(path);
    if (!file.is_object() || !file.contains("frames") || !file["frames"].is_array())
        input_error("{}: no \"frames\" list; a NeRF-synthetic, nerfstudio or instant-ngp camera file is needed",
                    path.string());
    if (file["frames"].empty()) input_error("{}: \"frames\" is empty; at least one view is needed", path.string());
    TransformsFile result;
    result.path = path;
    result.dialect = dialect_of(file);
    read_world(file, result);
    auto splits = split.empty() ? read_split_lists(file, result) : std::map<std::string, std::string>{};
    check_lists_used(splits, file["frames"], path);
    std::size_t unlisted = 0;
    for (std::size_t i = 0; i < file["frames"].size(); ++i) {
        try {
            FileFrame frame = read_frame(file["frames"][i], file, path, i, result.warnings);
            frame.split = split;
            if (result.has_splits) {
                const auto found = splits.find(checked_relative(frame.file_path, path.string()).string());
                if (found == splits.end()) {
                    ++unlisted;
                    continue;
                }
                frame.split = found->second;
            }
            result.frames.push_back(std::move(frame));
        } catch (const InputError&) {
            // Of a single file without lists no frame's split is known yet, so all are needed.
            if (split.empty() || needed(split)) throw;
        }
    }
    if (unlisted > 0)
        result.warnings.push_back(
            fmt::format("{}: {} frames are in none of the filename lists and were left out", path.string(), unlisted));
    if (result.dialect != Dialect::synthetic)
        std::stable_sort(result.frames.begin(), result.frames.end(),
                         [](const FileFrame& a, const FileFrame& b) { return a.file_path < b.file_path; });
    if (split.empty() && !result.has_splits) every_eighth_to_test(result.frames);
    return result;
}

}  // namespace fieldgraft
