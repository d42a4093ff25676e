// Pictures as the sweeps compare them: over the scene's background, in [0, 1], with the time they took.
#pragma once

#include "core/render/blended_view.h"
#include "core/scene/camera.h"

namespace fieldgraft {

struct TimedPictures {
    std::vector<Tensor> pictures;  // H×W×3
    double seconds = 0;            // a view
};
TimedPictures draw_views(const RadianceField& field, const EditStack& stack, const std::vector<Camera>& cameras,
                         const BlendedOptions& options, double scale = 1);

// H×W×3 of a view's rays, over the background of the field's scene.
Tensor picture_of(const FieldGeometry& geometry, const Tensor& color, const Tensor& alpha, const Camera& camera);
// The mean over the views.
double mean_psnr(const std::vector<Tensor>& pictures, const std::vector<Tensor>& expected);

}  // namespace fieldgraft
