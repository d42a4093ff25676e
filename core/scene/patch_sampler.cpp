#include "core/scene/patch_sampler.h"

#include "core/base/errors.h"

namespace fieldgraft {

Tensor Patch::pixels() const {
    Tensor result = at::empty({size * size, 2}, at::kLong);
    auto* out = result.data_ptr<std::int64_t>();
    for (std::int64_t j = 0; j < size; ++j) {
        for (std::int64_t i = 0; i < size; ++i) {
            *out++ = start_x + i * stride_x;
            *out++ = start_y + j * stride_y;
        }
    }
    return result;
}

Patch sample_patch(int width, int height, int size, Random& random) {
    if (size < 1) throw std::invalid_argument(fmt::format("sample_patch: size {} is not ≥ 1", size));
    if (width < size || height < size)
        input_error("a patch of {0}×{0} pixels does not fit a view of {1}×{2}; choose a patch of at most {3}", size,
                    width, height, std::min(width, height));
    Patch patch;
    patch.size = size;
    patch.stride_x = width / size;
    patch.stride_y = height / size;
    patch.start_x = random.below(static_cast<std::uint32_t>(patch.stride_x + width % size));
    patch.start_y = random.below(static_cast<std::uint32_t>(patch.stride_y + height % size));
    return patch;
}

}  // namespace fieldgraft
