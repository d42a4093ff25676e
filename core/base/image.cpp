#include "core/base/image.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <vector>

#include "core/base/errors.h"
#include "core/base/files.h"
#include "core/base/image_codecs.h"
#include "core/base/shape.h"

namespace fieldgraft {
namespace fs = std::filesystem;

namespace codecs {

void check_size(const std::string& where, std::int64_t width, std::int64_t height) {
    if (width < 1 || height < 1 || width > pixel_limit / height)
        input_error("{}: the header says {}×{} pixels; images of 1 to {} pixels can be read", where, width, height,
                    pixel_limit);
}

}  // namespace codecs

namespace {

enum class Format { png, jpeg, exr };

codecs::File open_file(const fs::path& path, const char* mode) {
    codecs::File file(std::fopen(path.c_str(), mode));
    if (!file) input_error("cannot open {}: {}", path.string(), std::strerror(errno));
    return file;
}

// By the first bytes, not by the name: a JPEG called .png is read as what it is.
Format detect(std::FILE* file, const fs::path& path) {
    if (fs::is_directory(path)) input_error("cannot read {}: it is a folder; give an image file", path.string());
    unsigned char magic[8] = {};
    const std::size_t count = std::fread(magic, 1, sizeof magic, file);
    std::rewind(file);
    const auto starts = [&](std::initializer_list<unsigned char> bytes) {
        return count >= bytes.size() && std::equal(bytes.begin(), bytes.end(), magic);
    };
    if (starts({0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'})) return Format::png;
    if (starts({0xff, 0xd8, 0xff})) return Format::jpeg;
    if (starts({0x76, 0x2f, 0x31, 0x01})) return Format::exr;
    if (count == 0) input_error("{}: empty file; a PNG, JPEG or EXR image is needed", path.string());
    input_error("{}: not an image this program reads; PNG, JPEG and EXR are", path.string());
}

// H×W → H×W×1; on the CPU, float32, contiguous; the channel count checked.
Tensor writable(const Tensor& image, const fs::path& path) {
    const bool plane = image.defined() && image.dim() == 2;
    if (!plane && (!image.defined() || image.dim() != 3 || (image.size(2) != 3 && image.size(2) != 4)))
        throw std::invalid_argument(
            fmt::format("{}: an image must be H×W, H×W×3 or H×W×4, got {}", path.string(), shape_text(image)));
    if (image.numel() == 0) throw std::invalid_argument(fmt::format("{}: an image of no pixels", path.string()));
    const Tensor pixels = image.detach().to(at::kCPU, at::kFloat).contiguous();
    return plane ? pixels.unsqueeze(2) : pixels;
}

// Which input pixels make one output pixel, along one axis: input[first + i] · weight[i], weights sum to 1.
struct Taps {
    std::int64_t first = 0;
    std::vector<float> weights;
};

// Shrinking: each output pixel is the average of the stretch it covers. Growing: linear between pixel centres.
std::vector<Taps> axis_taps(std::int64_t in, std::int64_t out) {
    std::vector<Taps> taps(out);
    const double scale = static_cast<double>(in) / static_cast<double>(out);
    for (std::int64_t i = 0; i < out; ++i) {
        if (scale >= 1) {
            const double low = i * scale, high = std::min((i + 1) * scale, static_cast<double>(in));
            taps[i].first = static_cast<std::int64_t>(low);
            for (std::int64_t j = taps[i].first; j < in && j < high; ++j) {
                const double share = std::min<double>(j + 1, high) - std::max<double>(j, low);
                taps[i].weights.push_back(static_cast<float>(share / (high - low)));
            }
        } else {
            const double centre = std::clamp((i + 0.5) * scale - 0.5, 0.0, static_cast<double>(in - 1));
            taps[i].first = std::min(static_cast<std::int64_t>(centre), std::max<std::int64_t>(in - 2, 0));
            const auto share = static_cast<float>(centre - static_cast<double>(taps[i].first));
            taps[i].weights = in == 1 ? std::vector<float>{1.0f} : std::vector<float>{1.0f - share, share};
        }
    }
    return taps;
}

// A×N×B → A×M×B, each run of B values along the middle axis summed by its taps.
Tensor apply_taps(const Tensor& input, const std::vector<Taps>& taps) {
    const std::int64_t outer = input.size(0), length = input.size(1), inner = input.size(2);
    const auto count = static_cast<std::int64_t>(taps.size());
    Tensor output = at::zeros({outer, count, inner}, at::kFloat);
    const float* in = input.data_ptr<float>();
    float* out = output.data_ptr<float>();
    for (std::int64_t a = 0; a < outer; ++a) {
        for (std::int64_t m = 0; m < count; ++m) {
            float* target = out + (a * count + m) * inner;
            const float* source = in + (a * length + taps[m].first) * inner;
            for (const float weight : taps[m].weights) {
                for (std::int64_t b = 0; b < inner; ++b) target[b] += weight * source[b];
                source += inner;
            }
        }
    }
    return output;
}

}  // namespace

namespace {

// uint8 or float32, as the decoders give it.
Tensor read_values(const fs::path& path) {
    const auto file = open_file(path, "rb");
    switch (detect(file.get(), path)) {
        case Format::png:
            return codecs::read_png(file.get(), path.string());
        case Format::jpeg:
            return codecs::read_jpeg(file.get(), path.string());
        default:
            return codecs::read_exr(path.string());
    }
}

}  // namespace

Tensor read_image(const fs::path& path) {
    const Tensor image = read_values(path);
    return image.scalar_type() == at::kByte ? image.to(at::kFloat).div_(255.0f) : image;
}

Tensor read_bytes(const fs::path& path) {
    const Tensor image = read_values(path);
    return image.scalar_type() == at::kByte ? image : to_bytes(image);
}

Tensor to_bytes(const Tensor& image) {
    return (image.clamp(0, 1) * 255.0f).round().to(at::kByte).contiguous();
}

std::array<int, 3> image_size(const fs::path& path) {
    const auto file = open_file(path, "rb");
    switch (detect(file.get(), path)) {
        case Format::png:
            return codecs::png_size(file.get(), path.string());
        case Format::jpeg:
            return codecs::jpeg_size(file.get(), path.string());
        default:
            return codecs::exr_size(path.string());
    }
}

void write_png(const fs::path& path, const Tensor& image) {
    const Tensor pixels = writable(image, path);
    if (!at::isfinite(pixels).all().item<bool>())
        throw std::invalid_argument(fmt::format("{}: the image holds NaN or infinite values", path.string()));
    const Tensor bytes = to_bytes(pixels);
    write_atomically(path, [&](const fs::path& temporary) {
        auto file = open_file(temporary, "wb");
        codecs::write_png(file.get(), path.string(), bytes);
        if (std::fflush(file.get()) != 0) failure("cannot write {}: {}", path.string(), std::strerror(errno));
    });
}

void write_exr(const fs::path& path, const Tensor& image) {
    const Tensor pixels = writable(image, path);
    write_atomically(path,
                     [&](const fs::path& temporary) { codecs::write_exr(temporary.string(), path.string(), pixels); });
}

Tensor over_background(const Tensor& image, const Tensor& background) {
    if (image.dim() < 1 || (image.size(-1) != 3 && image.size(-1) != 4))
        throw std::invalid_argument(
            fmt::format("over_background: the last side must be 3 or 4, got {}", shape_text(image)));
    if (background.numel() != 3)
        throw std::invalid_argument(
            fmt::format("over_background: a background has 3 values, got {}", background.numel()));
    if (image.size(-1) == 3) return image;
    const Tensor color = image.narrow(-1, 0, 3), alpha = image.narrow(-1, 3, 1);
    return color * alpha + background.reshape({3}).to(image.options()) * (1 - alpha);
}

Tensor resize_image(const Tensor& image, int height, int width) {
    if (image.dim() != 3 || image.numel() == 0 || height < 1 || width < 1)
        throw std::invalid_argument(fmt::format("resize_image: {} to {}×{}; an H×W×C image and a size ≥ 1 are needed",
                                                shape_text(image), height, width));
    const std::int64_t h = image.size(0), w = image.size(1), c = image.size(2);
    Tensor pixels = image.detach().to(at::kCPU, at::kFloat).contiguous();
    if (h == height && w == width) return pixels.clone();
    const bool alpha = c == 4;
    // Straight alpha: a colour counts by how much of it is there, or transparent pixels' colours would bleed in.
    if (alpha) pixels = at::cat({pixels.narrow(2, 0, 3) * pixels.narrow(2, 3, 1), pixels.narrow(2, 3, 1)}, 2);
    pixels = apply_taps(pixels.view({1, h, w * c}), axis_taps(h, height));
    pixels = apply_taps(pixels.view({height, w, c}), axis_taps(w, width));
    if (!alpha) return pixels;
    const Tensor a = pixels.narrow(2, 3, 1);
    const Tensor color = at::where(a > 0, pixels.narrow(2, 0, 3) / a.clamp_min(1e-12), at::zeros({}, at::kFloat));
    return at::cat({color, a}, 2);
}

}  // namespace fieldgraft
