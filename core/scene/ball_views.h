// Pictures of a ball, by formula: a scene that needs no files, to measure machines and to test on.
//
// The ball has radius 0.6 around the origin; its colour is 0.5 + 0.7 x at the point x, in [0, 1].
#pragma once

#include "core/base/torch.h"
#include "core/scene/camera.h"

namespace fieldgraft {

// H×W×4 uint8, straight alpha: a pixel shows the ball or nothing.
Tensor ball_pixels(const Camera& camera);
// Square cameras around the ball, about 3 from it, alternately from above and below.
std::vector<Camera> ball_cameras(int count, int size);

}  // namespace fieldgraft
