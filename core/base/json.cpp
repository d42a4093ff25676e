#include "core/base/json.h"

#include <algorithm>

#include "core/base/errors.h"
#include "core/base/files.h"

namespace fieldgraft {

namespace {

// Python writes NaN and Infinity where JSON has no word for them: say that instead of quoting the parser.
bool stops_at_nan(const std::string& text, std::size_t at) {
    const std::string near = text.substr(at < 9 ? 0 : at - 9, 18);
    return near.find("NaN") != std::string::npos || near.find("Infinity") != std::string::npos;
}

// nlohmann's text without its "[json.exception.parse_error.101] parse error at line …: " opening.
std::string parse_reason(const std::string& what) {
    const auto at = what.find(": ");
    std::string reason = at == std::string::npos ? what : what.substr(at + 2);
    std::replace(reason.begin(), reason.end(), '\n', ' ');
    return reason;
}

}  // namespace

Json read_json(const std::filesystem::path& path) {
    std::string text = read_file(path);
    // Windows tools put a byte-order mark in front; without it the columns below count right.
    if (text.starts_with("\xEF\xBB\xBF")) text.erase(0, 3);
    try {
        return Json::parse(text);
    } catch (const Json::parse_error& error) {
        const std::size_t end = std::min(error.byte == 0 ? 0 : error.byte - 1, text.size());
        const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(end), '\n');
        const auto start = end == 0 ? std::string::npos : text.rfind('\n', end - 1);
        const auto column = 1 + (start == std::string::npos ? end : end - start - 1);
        if (stops_at_nan(text, end))
            input_error("{}: NaN or Infinity at line {}, column {}; a finite number is needed", path.string(), line,
                        column);
        input_error("{}: not valid JSON at line {}, column {}: {}", path.string(), line, column,
                    parse_reason(error.what()));
    }
}

void write_json(const std::filesystem::path& path, const Json& value, int indent) {
    write_file(path, value.dump(indent) + "\n");
}

}  // namespace fieldgraft
