#include "core/edit/mask_ops.h"

#include <cmath>
#include <stdexcept>

#include "core/base/errors.h"
#include "core/base/image.h"

namespace fieldgraft {

namespace {

void check(const Tensor& mask, const char* what) {
    if (!mask.defined() || mask.dim() != 2 || mask.scalar_type() != at::kBool)
        throw std::invalid_argument(fmt::format("{}: an H×W bool mask is expected", what));
}

}  // namespace

int dilation_radius(int dilations, int size) {
    if (dilations < 0 || size < 1)
        throw std::invalid_argument(fmt::format("dilation_radius: {} dilations at size {}", dilations, size));
    return static_cast<int>(std::lround(2.0 * dilations * size / 352.0));
}

Tensor dilate(const Tensor& mask, int radius) {
    check(mask, "dilate");
    if (radius <= 0 || mask.numel() == 0) return mask;
    // A square is the product of a row and a column; outside the image there is nothing.
    const Tensor whole = mask.to(at::kFloat).unsqueeze(0).unsqueeze(0);
    const Tensor padded = at::constant_pad_nd(whole, {radius, radius, radius, radius}, 0);
    const Tensor rows = at::max_pool2d(padded, {1, 2 * radius + 1}, {1, 1});
    return at::max_pool2d(rows, {2 * radius + 1, 1}, {1, 1}).squeeze(0).squeeze(0) > 0.5;
}

Tensor resize_nearest(const Tensor& mask, int height, int width) {
    check(mask, "resize_nearest");
    const auto pick = [](int wanted, std::int64_t have) {
        // Pixel centres: the source pixel that holds the centre of the wanted one.
        const Tensor centres = (at::arange(wanted, at::kDouble) + 0.5) * (static_cast<double>(have) / wanted);
        return centres.floor().to(at::kLong).clamp(0, have - 1);
    };
    return mask.index_select(0, pick(height, mask.size(0))).index_select(1, pick(width, mask.size(1)));
}

RegionMasks region_masks(const Tensor& mask, int dilations, int size) {
    return region_masks(mask, dilations, dilations, size);
}

RegionMasks region_masks(const Tensor& mask, int inner, int outer, int size) {
    check(mask, "region_masks");
    const int width = static_cast<int>(mask.size(1));
    const Tensor positive = dilate(mask, dilation_radius(inner, width));
    const Tensor negative = dilate(positive, dilation_radius(outer, width)).logical_not();
    return {resize_nearest(positive, size, size), resize_nearest(negative, size, size)};
}

Tensor read_mask(const std::filesystem::path& path) {
    const Tensor image = read_image(path);
    return image.slice(2, 0, 3).mean(2) > 0.5;
}

}  // namespace fieldgraft
