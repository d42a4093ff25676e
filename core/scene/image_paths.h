// Finding the image a camera file means. Paths are relative to the camera file's folder and must stay inside it.
//
// Tried in order: the path itself; with .png, .jpg, .jpeg, .exr (also in capitals) added; with its extension replaced
// by those; and the names that broken Blender writers meant: "a.png.png" → "a.png", "frame_7.png0001.png" → "0001.png",
// "train/train/a" → "train/a"; at last the bare file name in "images/" and beside the camera file.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace fieldgraft {

// "./a\b.png" → "a/b.png". Throws InputError, naming `where`, for absolute paths and those that lead out of the folder.
std::filesystem::path checked_relative(const std::string& text, const std::string& where);

struct FoundImage {
    std::filesystem::path path;
    bool guessed = false;  // not the path itself nor one with an extension added
};
// Throws InputError that lists what was tried.
FoundImage find_image(const std::filesystem::path& folder, const std::string& file_path, const std::string& where);

}  // namespace fieldgraft
