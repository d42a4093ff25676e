#include "core/guidance/preprocess.h"

#include <spdlog/fmt/ranges.h>

#include <stdexcept>

#include "core/base/errors.h"

namespace fieldgraft {

void check_images(const Tensor& images, const char* who) {
    if (!images.defined() || images.dim() != 4 || images.size(1) != 3 || images.numel() == 0)
        throw std::invalid_argument(
            fmt::format("{}: images must be N×3×h×w, not [{}]", who,
                        images.defined() ? fmt::format("{}", fmt::join(images.sizes(), ", ")) : ""));
    if (!images.is_floating_point())
        throw std::invalid_argument(fmt::format("{}: images must be floating point in [0, 1]", who));
}

Tensor prepare_images(const Tensor& images, const Preprocess& preprocess) {
    check_images(images, "prepare_images");
    const std::int64_t size = preprocess.image_size;
    Tensor x = images;
    if (x.size(2) != size || x.size(3) != size)
        x = preprocess.bicubic ? at::_upsample_bicubic2d_aa(x, {size, size}, false)
                               : at::_upsample_bilinear2d_aa(x, {size, size}, false);
    const auto channel = [&](const std::array<double, 3>& values) {
        return at::tensor(at::ArrayRef<double>(values.data(), 3), x.options().requires_grad(false)).view({1, 3, 1, 1});
    };
    return (x - channel(preprocess.mean)) / channel(preprocess.deviation);
}

}  // namespace fieldgraft
