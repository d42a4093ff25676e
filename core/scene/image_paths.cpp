#include "core/scene/image_paths.h"

#include <algorithm>
#include <array>
#include <cctype>

#include "core/base/errors.h"

namespace fieldgraft {
namespace fs = std::filesystem;

namespace {

constexpr std::array extensions = {".png", ".jpg", ".jpeg", ".exr", ".PNG", ".JPG", ".JPEG", ".EXR"};

bool has_image_extension(const fs::path& path) {
    return std::find(extensions.begin(), extensions.end(), path.extension().string()) != extensions.end();
}

void add(std::vector<fs::path>& list, const fs::path& path) {
    if (!path.empty() && std::find(list.begin(), list.end(), path) == list.end()) list.push_back(path);
}

// `path` as it is and with each extension, or with another in the place of its own.
void add_with_extensions(std::vector<fs::path>& list, const fs::path& path) {
    if (has_image_extension(path)) add(list, path);
    for (const char* extension : extensions) {
        fs::path other = path;
        if (has_image_extension(path)) {
            other.replace_extension(extension);
        } else {
            other += extension;
        }
        add(list, other);
    }
}

std::vector<fs::path> repaired_names(const fs::path& path) {
    std::vector<fs::path> list;
    const fs::path stem = path.stem();
    if (has_image_extension(stem)) add(list, path.parent_path() / stem);
    const std::string name = path.filename().string();
    for (const char* extension : extensions) {
        const auto at = name.find(extension);
        const std::string rest = at == std::string::npos ? "" : name.substr(at + std::string(extension).size());
        if (!rest.empty() && rest.front() != '.') add_with_extensions(list, path.parent_path() / rest);
    }
    const auto first = path.begin();
    if (std::distance(path.begin(), path.end()) > 2 && *first == *std::next(first))
        add_with_extensions(list, path.lexically_relative(*first));
    add_with_extensions(list, fs::path("images") / path.filename());
    add_with_extensions(list, path.filename());
    return list;
}

}  // namespace

fs::path checked_relative(const std::string& text, const std::string& where) {
    std::string slashes = text;
    std::replace(slashes.begin(), slashes.end(), '\\', '/');
    const bool drive = slashes.size() >= 2 && slashes[1] == ':' && std::isalpha(static_cast<unsigned char>(slashes[0]));
    if (slashes.empty()) input_error("{}: an empty file path; a path relative to the camera file is needed", where);
    if (slashes.find('\0') != std::string::npos) input_error("{}: a file path with a zero byte in it", where);
    if (slashes.front() == '/' || drive)
        input_error("{}: '{}' is an absolute path; make it relative to the camera file's folder", where, text);
    const fs::path path = fs::path(slashes).lexically_normal();
    if (*path.begin() == "..")
        input_error("{}: '{}' leads out of the camera file's folder; images must lie inside it", where, text);
    return path;
}

FoundImage find_image(const fs::path& folder, const std::string& file_path, const std::string& where) {
    const fs::path path = checked_relative(file_path, where);
    std::vector<fs::path> tried;
    add_with_extensions(tried, path);
    const std::size_t plain = has_image_extension(path) ? 1 : tried.size();
    for (const fs::path& other : repaired_names(path)) add(tried, other);
    std::error_code error;
    for (std::size_t i = 0; i < tried.size(); ++i)
        if (fs::is_regular_file(folder / tried[i], error)) return {folder / tried[i], i >= plain};

    std::string names;
    for (std::size_t i = 0; i < std::min<std::size_t>(tried.size(), 4); ++i)
        names += (i == 0 ? "" : ", ") + tried[i].string();
    if (tried.size() > 4) names += fmt::format(" and {} more", tried.size() - 4);
    input_error("{}: image '{}' not found in {} (tried {})", where, file_path, folder.string(), names);
}

}  // namespace fieldgraft
