// The three file formats behind image.h, one source file each. A decoder gets an open file that begins with its magic
// number and gives H×W×3 or H×W×4: uint8 where the file holds 8 bits a channel, else float32 as image.h describes;
// `where` is the path for the messages.
// Every decoder throws InputError for a damaged or truncated file.
#pragma once

#include <array>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>

#include "core/base/torch.h"

namespace fieldgraft::codecs {

struct CloseFile {
    void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

// An image may have this many pixels; a header that claims more is taken for damage (or an attack on the memory).
constexpr std::int64_t pixel_limit = std::int64_t{1} << 28;
void check_size(const std::string& where, std::int64_t width, std::int64_t height);

std::array<int, 3> png_size(std::FILE* file, const std::string& where);
Tensor read_png(std::FILE* file, const std::string& where);
// `pixels` is uint8 H×W×C, C in {1, 3, 4}, contiguous.
void write_png(std::FILE* file, const std::string& where, const Tensor& pixels);

std::array<int, 3> jpeg_size(std::FILE* file, const std::string& where);
Tensor read_jpeg(std::FILE* file, const std::string& where);

std::array<int, 3> exr_size(const std::string& where);
Tensor read_exr(const std::string& where);
// `pixels` is float32 H×W×C, C in {1, 3, 4}, contiguous; written to `target`, called `where` in messages.
void write_exr(const std::string& target, const std::string& where, const Tensor& pixels);

}  // namespace fieldgraft::codecs
