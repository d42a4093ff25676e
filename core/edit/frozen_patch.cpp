#include "core/edit/frozen_patch.h"

namespace fieldgraft {

Tensor FrozenPatch::over(const Tensor& background) const {
    return (image + (1 - opacity).unsqueeze(1) * background).reshape({size, size, 3});
}

}  // namespace fieldgraft
