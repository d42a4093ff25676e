#include "core/base/files.h"

#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <fstream>

#include "core/base/errors.h"

namespace fieldgraft {
namespace fs = std::filesystem;

namespace {

// "dir/name.ext" → "dir/.name.PID-N.part.ext": hidden, unique in this process and among processes, same extension.
fs::path temporary_name(const fs::path& path) {
    static std::atomic<unsigned> counter{0};
    const auto name =
        fmt::format(".{}.{}-{}.part{}", path.stem().string(), ::getpid(), counter++, path.extension().string());
    return path.parent_path() / name;
}

}  // namespace

void write_atomically(const fs::path& path, const std::function<void(const fs::path&)>& write) {
    if (path.filename().empty()) input_error("cannot write '{}': it names a folder, not a file", path.string());
    std::error_code error;
    if (path.has_parent_path()) fs::create_directories(path.parent_path(), error);
    if (error) failure("cannot create the folder of {}: {}", path.string(), error.message());
    if (fs::is_directory(path)) input_error("cannot write {}: a folder of that name is in the way", path.string());
    const fs::path temporary = temporary_name(path);
    try {
        write(temporary);
        fs::rename(temporary, path, error);
        if (error) failure("cannot rename {} to {}: {}", temporary.string(), path.string(), error.message());
    } catch (...) {
        fs::remove(temporary, error);
        throw;
    }
}

void write_file(const fs::path& path, std::string_view bytes) {
    write_atomically(path, [&](const fs::path& temporary) {
        std::ofstream out(temporary, std::ios::binary);
        out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
        out.close();
        if (!out) failure("cannot write {} ({} bytes): {}", path.string(), bytes.size(), std::strerror(errno));
    });
}

std::string read_file(const fs::path& path) {
    std::error_code error;
    if (fs::is_directory(path, error)) input_error("cannot read {}: it is a folder; give a file", path.string());
    std::ifstream in(path, std::ios::binary | std::ios::ate);
    if (!in) input_error("cannot read {}: {}", path.string(), std::strerror(errno));
    const std::streamoff size = in.tellg();
    if (size < 0) input_error("cannot read {}: not an ordinary file", path.string());
    std::string bytes(static_cast<std::size_t>(size), '\0');
    in.seekg(0);
    in.read(bytes.data(), size);
    if (!in) input_error("cannot read {}: it ended after {} of {} bytes", path.string(), in.gcount(), size);
    return bytes;
}

}  // namespace fieldgraft
