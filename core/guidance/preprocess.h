// From a picture to what an image tower takes: resized to S×S (antialiased: every pixel of the picture counts, by a
// bicubic or bilinear kernel), then (x − mean) / deviation per channel. Pictures that are not square are squeezed, not
// cropped. Differentiable in the pixels.
#pragma once

#include "core/base/torch.h"
#include "core/guidance/config.h"

namespace fieldgraft {

// images: N×3×h×w, floating point, RGB in [0, 1] → N×3×S×S of the same type. Throws std::invalid_argument.
Tensor prepare_images(const Tensor& images, const Preprocess& preprocess);
// Throws std::invalid_argument unless images are N×3×h×w floating point with N, h, w ≥ 1; `who` opens the message.
void check_images(const Tensor& images, const char* who);

}  // namespace fieldgraft
