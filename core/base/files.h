// Files that are either whole or absent: everything is written to a temporary name in the same folder, then renamed.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

namespace fieldgraft {

// Calls write(temporary) and renames the result over `path` (creating its folder). If write throws, the temporary file
// is removed and `path` is as it was. The temporary name keeps path's extension (libraries choose formats by it).
void write_atomically(const std::filesystem::path& path,
                      const std::function<void(const std::filesystem::path&)>& write);
void write_file(const std::filesystem::path& path, std::string_view bytes);
// Throws InputError if the file is missing or unreadable.
std::string read_file(const std::filesystem::path& path);

}  // namespace fieldgraft
