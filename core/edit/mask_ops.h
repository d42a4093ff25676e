// Two-dimensional masks: dilation, the regions M₊ and M₋, user masks (Blending-NeRF, sec. 4.3 and appendix A).
//
// Masks are H×W bool tensors on the CPU, row 0 at the top. N dilations by a 5×5 square at 352×352 are one dilation by a
// square of radius 2N; at another size s the radius is 2N · s / 352, rounded.
//   M₊ = N_f dilations of M        M₋ = NOT (N_f further dilations of M₊)        resized to S×S by the nearest pixel
#pragma once

#include <filesystem>

#include "core/edit/losses.h"

namespace fieldgraft {

int dilation_radius(int dilations, int size);
// True where any pixel within `radius` (a square, clipped at the border) is.
Tensor dilate(const Tensor& mask, int radius);
Tensor resize_nearest(const Tensor& mask, int height, int width);
RegionMasks region_masks(const Tensor& mask, int dilations, int size);
// The same with other numbers of dilations from M to M₊ and from M₊ to the border of M₋.
RegionMasks region_masks(const Tensor& mask, int inner, int outer, int size);
// An image file as a mask: grey (or the mean of RGB) above ½; alpha is ignored.
Tensor read_mask(const std::filesystem::path& path);

}  // namespace fieldgraft
