// A contiguous float32 tensor's values as the kernels take them.
#pragma once

#include <span>

#include "core/base/torch.h"

namespace fieldgraft {

inline std::span<const float> values(const Tensor& tensor) {
    return {tensor.const_data_ptr<float>(), static_cast<std::size_t>(tensor.numel())};
}
inline std::span<float> mutable_values(const Tensor& tensor) {
    return {tensor.mutable_data_ptr<float>(), static_cast<std::size_t>(tensor.numel())};
}

}  // namespace fieldgraft
