#include "core/base/safetensors.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <vector>

#include "core/base/errors.h"
#include "core/base/files.h"
#include "core/base/json.h"
#include "core/base/sha256.h"

namespace fieldgraft {
namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little, "the raw tensor data is little-endian");

namespace {

struct Dtype {
    const char* name;
    at::ScalarType type;
};
constexpr std::array<Dtype, 8> dtypes = {{{"F64", at::kDouble},
                                          {"F32", at::kFloat},
                                          {"F16", at::kHalf},
                                          {"BF16", at::kBFloat16},
                                          {"I64", at::kLong},
                                          {"I32", at::kInt},
                                          {"U8", at::kByte},
                                          {"BOOL", at::kBool}}};
constexpr const char* dtype_names = "F64, F32, F16, BF16, I64, I32, U8, BOOL";
// The header of the format may take 100 MB at most; more is a sign of a file of another kind.
constexpr std::uint64_t header_limit = 100'000'000;

std::string dtype_name(const Tensor& tensor, const std::string& name) {
    for (const Dtype& dtype : dtypes)
        if (dtype.type == tensor.scalar_type()) return dtype.name;
    throw std::invalid_argument(fmt::format("tensor '{}' has type {}, safetensors files here hold {}", name,
                                            c10::toString(tensor.scalar_type()), dtype_names));
}

struct Entry {
    std::string name;
    at::ScalarType type;
    std::vector<std::int64_t> shape;
    std::uint64_t begin, end;
};

// A reader that knows what it is reading, for the messages.
class Reader {
  public:
    explicit Reader(const fs::path& path) : path_(path.string()), bytes_(read_file(path)) {}

    SafeTensors read() {
        SafeTensors file;
        file.origin = path_;
        const Json header = read_header();
        std::vector<Entry> entries;
        for (const auto& [name, value] : header.items()) {
            if (name == "__metadata__") {
                read_metadata(value, file.metadata);
            } else {
                entries.push_back(read_entry(name, value));
            }
        }
        check_layout(entries);
        for (const Entry& entry : entries) file.tensors.emplace(entry.name, read_tensor(entry));
        return file;
    }

  private:
    template <class... Args>
    [[noreturn]] void bad(fmt::format_string<Args...> format, Args&&... args) const {
        input_error("{}: {}; a whole safetensors file is needed", path_,
                    fmt::format(format, std::forward<Args>(args)...));
    }

    Json read_header() {
        std::uint64_t length = 0;
        if (bytes_.size() < 8) bad("only {} bytes long", bytes_.size());
        std::memcpy(&length, bytes_.data(), 8);
        if (length > header_limit || length > bytes_.size() - 8)
            bad("the header should take {} bytes, {} follow", length, bytes_.size() - 8);
        data_ = 8 + length;
        const char* text = bytes_.data() + 8;
        Json header = Json::parse(text, text + length, nullptr, false);
        if (header.is_discarded() || !header.is_object()) bad("the header is not a JSON object");
        return header;
    }

    void read_metadata(const Json& value, std::map<std::string, std::string>& metadata) const {
        if (!value.is_object()) bad("__metadata__ is not an object");
        for (const auto& [key, text] : value.items()) {
            if (!text.is_string()) bad("__metadata__ '{}' is not a string", key);
            metadata[key] = text.get<std::string>();
        }
    }

    Entry read_entry(const std::string& name, const Json& value) const {
        const auto is_list = [&](const char* key) { return value.contains(key) && value[key].is_array(); };
        const auto is_count = [](const Json& number) { return number.is_number_unsigned(); };
        if (!value.is_object() || !value.contains("dtype") || !value["dtype"].is_string() || !is_list("shape") ||
            !is_list("data_offsets") || value["data_offsets"].size() != 2)
            bad("tensor '{}' lacks dtype, shape or data_offsets", name);
        const Json &shape = value["shape"], &offsets = value["data_offsets"];
        if (!std::all_of(shape.begin(), shape.end(), is_count) ||
            !std::all_of(offsets.begin(), offsets.end(), is_count))
            bad("tensor '{}' has a shape or offset that is no whole number ≥ 0", name);
        Entry entry{name, at::kFloat, {}, offsets[0], offsets[1]};
        const std::string type = value["dtype"];
        const auto found = std::find_if(dtypes.begin(), dtypes.end(), [&](const Dtype& d) { return type == d.name; });
        if (found == dtypes.end())
            input_error("{}: tensor '{}' has dtype {}; supported are {}", path_, name, type, dtype_names);
        entry.type = found->type;
        std::uint64_t count = c10::elementSize(entry.type);
        for (const Json& side : shape) {
            const std::uint64_t extent = side;
            // Sizes are bounded by the file's; the product must not wrap around on the way.
            if (extent != 0 && count > std::numeric_limits<std::int64_t>::max() / extent)
                bad("tensor '{}' has the impossible shape {}", name, shape.dump());
            count *= extent;
            entry.shape.push_back(static_cast<std::int64_t>(extent));
        }
        if (entry.end < entry.begin || entry.end - entry.begin != count)
            bad("tensor '{}' ({} {}) needs {} bytes, its offsets are [{}, {}]", name, type, shape.dump(), count,
                entry.begin, entry.end);
        if (entry.end > bytes_.size() - data_)
            bad("tensor '{}' ends at byte {} of the data, the file has {}", name, entry.end, bytes_.size() - data_);
        return entry;
    }

    // The format wants the tensors to tile the data: no overlap, no hole, nothing after the last.
    void check_layout(std::vector<Entry>& entries) const {
        std::sort(entries.begin(), entries.end(),
                  [](const Entry& a, const Entry& b) { return std::pair(a.begin, a.end) < std::pair(b.begin, b.end); });
        std::uint64_t at = 0;
        for (const Entry& entry : entries) {
            if (entry.begin != at)
                bad("tensor '{}' begins at byte {} of the data, expected {}", entry.name, entry.begin, at);
            at = entry.end;
        }
        if (at != bytes_.size() - data_) bad("{} bytes follow the last tensor", bytes_.size() - data_ - at);
    }

    Tensor read_tensor(const Entry& entry) const {
        Tensor tensor = at::empty(entry.shape, at::TensorOptions().dtype(entry.type));
        const char* source = bytes_.data() + data_ + entry.begin;
        if (entry.end > entry.begin) std::memcpy(tensor.data_ptr(), source, entry.end - entry.begin);
        // A bool that is neither 0 nor 1 is undefined behaviour waiting to happen.
        if (entry.type == at::kBool &&
            std::any_of(source, source + (entry.end - entry.begin), [](char c) { return c & ~1; }))
            bad("tensor '{}' is BOOL and holds bytes other than 0 and 1", entry.name);
        return tensor;
    }

    std::string path_;
    std::string bytes_;
    std::uint64_t data_ = 0;
};

Tensor plain(const Tensor& tensor, const std::string& name) {
    if (!tensor.defined()) throw std::invalid_argument(fmt::format("tensor '{}' is undefined", name));
    return tensor.detach().to(at::kCPU).contiguous();
}

}  // namespace

const Tensor& SafeTensors::at(const std::string& name) const {
    const auto found = tensors.find(name);
    if (found == tensors.end()) {
        const std::string file = origin.empty() ? "safetensors" : origin;
        input_error("{}: no tensor '{}' among its {} tensors; is it a file of another kind?", file, name,
                    tensors.size());
    }
    return found->second;
}

SafeTensors load_safetensors(const fs::path& path) {
    return Reader(path).read();
}

void save_safetensors(const fs::path& path, const std::map<std::string, Tensor>& tensors,
                      const std::map<std::string, std::string>& metadata) {
    nlohmann::ordered_json header = nlohmann::ordered_json::object();
    if (!metadata.empty()) header["__metadata__"] = metadata;
    std::vector<Tensor> parts;
    std::uint64_t at = 0;
    for (const auto& [name, tensor] : tensors) {
        if (name == "__metadata__") throw std::invalid_argument("a tensor cannot be called __metadata__");
        parts.push_back(plain(tensor, name));
        const std::uint64_t end = at + parts.back().nbytes();
        header[name] = {
            {"dtype", dtype_name(tensor, name)}, {"shape", tensor.sizes().vec()}, {"data_offsets", {at, end}}};
        at = end;
    }
    std::string text = header.dump();
    text.resize((text.size() + 7) / 8 * 8, ' ');  // so that the data starts aligned, as the format's own writer does
    const std::uint64_t length = text.size();
    write_atomically(path, [&](const fs::path& temporary) {
        std::ofstream out(temporary, std::ios::binary);
        out.write(reinterpret_cast<const char*>(&length), 8);
        out.write(text.data(), static_cast<std::streamsize>(text.size()));
        for (const Tensor& part : parts)
            if (part.numel() > 0)
                out.write(static_cast<const char*>(part.data_ptr()), static_cast<std::streamsize>(part.nbytes()));
        out.close();
        if (!out) failure("cannot write {} ({} bytes): is the disk full?", path.string(), 8 + length + at);
    });
}

std::string not_finite(const std::map<std::string, Tensor>& tensors) {
    for (const auto& [name, tensor] : tensors) {
        if (!tensor.is_floating_point()) continue;
        // Any NaN or Inf makes the sum one. A sum of large numbers may become one, too: then each is looked at.
        if (std::isfinite(tensor.detach().sum(at::kDouble).item<double>())) continue;
        if (!at::isfinite(tensor).all().item<bool>()) return name;
    }
    return "";
}

void save_finite_safetensors(const fs::path& path, const std::map<std::string, Tensor>& tensors,
                             const std::map<std::string, std::string>& metadata) {
    const std::string bad = not_finite(tensors);
    if (!bad.empty()) failure("{} was not written: \"{}\" holds numbers that are not finite", path.string(), bad);
    save_safetensors(path, tensors, metadata);
}

std::string content_hash(const std::map<std::string, Tensor>& tensors) {
    Sha256 hash;
    for (const auto& [name, tensor] : tensors) {
        const Tensor part = plain(tensor, name);
        // Lengths first, so that no two different contents run together into the same bytes.
        hash.update(fmt::format("{}:{}:{}:", name.size(), name, dtype_name(part, name)));
        for (const std::int64_t side : part.sizes()) hash.update(fmt::format("{},", side));
        hash.update(fmt::format(":{}:", part.nbytes()));
        if (part.numel() > 0) hash.update({static_cast<const std::uint8_t*>(part.data_ptr()), part.nbytes()});
    }
    return hash.hex();
}

}  // namespace fieldgraft
