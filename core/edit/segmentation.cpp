#include "core/edit/segmentation.h"

#include <cmath>
#include <stdexcept>

#include "core/base/errors.h"

namespace fieldgraft {

namespace {

Tensor logits_of(Guidance& guide, const Tensor& pictures, const std::string& text) {
    const Tensor each = guide.segment_each(pictures, {text, "photo"});
    return each.select(1, 0) - each.select(1, 1);
}

// The whole, and 3×3 overlapping windows of 5/9 the side, each voting where it looks.
Tensor over_crops(Guidance& guide, const Tensor& picture, const std::string& text) {
    const std::int64_t size = picture.size(2), side = std::max<std::int64_t>(8, std::lround(size * 5.0 / 9.0));
    std::vector<Tensor> crops;
    std::vector<std::array<std::int64_t, 2>> corners;
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column) {
            const std::int64_t y = (size - side) * row / 2, x = (size - side) * column / 2;
            const Tensor crop = picture.slice(2, y, y + side).slice(3, x, x + side);
            // An empty crop has nothing to find; asking costs time and can only add noise.
            if ((crop.amax() - crop.amin()).item<float>() < 0.02f) continue;
            crops.push_back(crop);
            corners.push_back({y, x});
        }
    }
    constexpr float whole_weight = 2;  // it alone sees how parts belong together
    Tensor sum = logits_of(guide, picture, text)[0] * whole_weight;
    Tensor count = at::full_like(sum, whole_weight);
    if (crops.empty()) return sum / count;
    const Tensor found = logits_of(guide, at::cat(crops), text);
    for (std::size_t i = 0; i < crops.size(); ++i) {
        const auto [y, x] = corners[i];
        sum.slice(0, y, y + side).slice(1, x, x + side).add_(found[static_cast<std::int64_t>(i)]);
        count.slice(0, y, y + side).slice(1, x, x + side).add_(1);
    }
    return sum / count;
}

}  // namespace

Tensor segment_difference(Guidance& guide, const Tensor& image, const std::string& text) {
    if (image.dim() != 3 || image.size(0) != image.size(1) || image.size(2) != 3)
        throw std::invalid_argument("segment_difference: an S×S×3 picture is expected");
    if (!guide.has_segmenter())
        input_error(
            "the guidance folder has no segmenter: give one as --segmenter DIR, or draw the region with --mask and "
            "--mask-only");
    at::NoGradGuard no_gradients;
    Tensor picture = image.permute({2, 0, 1}).unsqueeze(0).contiguous();
    if (guide.config().segmenter.type == "film_pyramid") return over_crops(guide, picture, text);
    constexpr std::int64_t size = 352;
    picture = at::upsample_bilinear2d(picture, {size, size}, false);
    return logits_of(guide, picture, text)[0];
}

}  // namespace fieldgraft
