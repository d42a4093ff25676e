// NumPy arrays ↔ tensors for the bindings, without torch's own Python layer: float32, C order, always copied, so that
// neither side keeps the other's memory.
#pragma once

#include <pybind11/numpy.h>

#include "core/base/torch.h"

namespace fieldgraft {

using FloatArray = pybind11::array_t<float, pybind11::array::c_style | pybind11::array::forcecast>;

inline Tensor to_tensor(const FloatArray& array) {
    const std::vector<std::int64_t> shape(array.shape(), array.shape() + array.ndim());
    Tensor out = at::empty(shape, torch::kFloat);
    std::copy_n(array.data(), array.size(), out.data_ptr<float>());
    return out;
}

inline FloatArray to_array(const Tensor& tensor) {
    const Tensor flat = tensor.detach().to(torch::kCPU, torch::kFloat).contiguous();
    FloatArray out(std::vector<pybind11::ssize_t>(flat.sizes().begin(), flat.sizes().end()));
    std::copy_n(flat.data_ptr<float>(), flat.numel(), out.mutable_data());
    return out;
}

}  // namespace fieldgraft
