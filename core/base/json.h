// JSON as the whole project uses it (nlohmann::json), and reading it from files with one-line errors.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

namespace fieldgraft {

using Json = nlohmann::json;

// Throws InputError naming the file, and the line and column where parsing stopped.
Json read_json(const std::filesystem::path& path);
// Written to a temporary name beside `path`, then renamed.
void write_json(const std::filesystem::path& path, const Json& value, int indent = 2);

}  // namespace fieldgraft
