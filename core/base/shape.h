// Tensor shapes as error messages show them: "400×400×3", "scalar" for no sides, "none" for an undefined tensor.
#pragma once

#include <string>

#include "core/base/torch.h"

namespace fieldgraft {

inline std::string shape_text(const Tensor& tensor) {
    if (!tensor.defined()) return "none";
    if (tensor.dim() == 0) return "scalar";
    std::string text;
    for (const auto side : tensor.sizes()) text += (text.empty() ? "" : "×") + std::to_string(side);
    return text;
}

}  // namespace fieldgraft
