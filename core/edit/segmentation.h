// Where the segmenter sees a text in a picture: h(I, T) − h(I, "photo"), positive inside (Blending-NeRF, sec. 4.3).
//
// The picture is S×S×3 in [0, 1] over its background. CLIPSeg looks at it once at 352×352. The built-in segmenter works
// at a low resolution, so it looks at the whole and at overlapping crops, and its logits are averaged. No gradients.
#pragma once

#include <string>

#include "core/guidance/guidance.h"

namespace fieldgraft {

// Logit differences at the segmenter's own picture size (352 for CLIPSeg, the picture's own for the built-in one): s×s.
Tensor segment_difference(Guidance& guide, const Tensor& image, const std::string& text);

}  // namespace fieldgraft
