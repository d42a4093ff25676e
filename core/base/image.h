// Images in memory and on disk. Pixels are float32, H×W×C, row 0 at the top. PNG/JPEG values are the file's own
// (sRGB-encoded) values in [0, 1]; EXR values are stored as they are. Alpha is straight in memory and in PNG.
#pragma once

#include <filesystem>

#include "core/base/torch.h"

namespace fieldgraft {

// H×W×3 or H×W×4 (grey becomes RGB, grey+alpha RGBA; 8 and 16 bit PNG, JPEG, EXR). Throws InputError: missing, unknown
// format, truncated or corrupt (a PNG or JPEG that ends early is an error, not a half-grey picture).
Tensor read_image(const std::filesystem::path& path);
// The same as uint8, [0, 1] being 0 to 255: what PNG and JPEG with 8 bits a channel hold, others rounded and clamped.
Tensor read_bytes(const std::filesystem::path& path);
// float32 in [0, 1] → uint8, rounded and clamped.
Tensor to_bytes(const Tensor& image);
// Only the size {height, width, channels}, from the header.
std::array<int, 3> image_size(const std::filesystem::path& path);

// H×W, H×W×3 or H×W×4, values clamped to [0, 1], 8 bit, rounded to nearest.
void write_png(const std::filesystem::path& path, const Tensor& image);
// Float32 EXR: H×W (channel Y), H×W×3 (R, G, B), H×W×4 (R, G, B, A).
void write_exr(const std::filesystem::path& path, const Tensor& image);

// RGBA over a background colour (3 floats) → H×W×3; an RGB image comes back as it is.
Tensor over_background(const Tensor& image, const Tensor& background);
// Antialiased resize of an H×W×C image: the average over the area a pixel covers when it shrinks, linear when it grows.
// Four channels are RGBA: colours are averaged by alpha. On the CPU, not differentiable.
Tensor resize_image(const Tensor& image, int height, int width);

}  // namespace fieldgraft
