// Where density may appear: a coarse grid of votes from masks of several views (a soft visual hull, Laurentini 1994).
//
// A cell counts when at least `share` of the views that see its centre have it in their mask, and at least `min_views`
// see it; then the set is grown by `grow` cells. A hard hull (share 1) dies of one wrong mask. A view sees a cell whose
// centre projects into the image, in front of the camera and, where the view has a depth map, no farther than `slack`
// behind what the pixel shows. Model coordinates; masks H×W of the camera's shape or of any other resolution of the
// same picture (nearest pixel). Not differentiable.
#pragma once

#include <vector>

#include "core/base/torch.h"
#include "core/field/geometry.h"
#include "core/scene/camera.h"

namespace fieldgraft {

struct MaskView {
    Camera camera;
    Tensor mask;   // H×W, bool, uint8 or float in [0, 1]; above ½ is inside
    Tensor depth;  // H×W float32 along the ray, 0 where nothing is hit; undefined: nothing hides anything
};

struct HullOptions {
    int resolution = 64;
    double share = 0.7;
    int min_views = 2;
    int grow = 0;        // cells
    double slack = 0.0;  // model units behind the depth map that still count as seen
};

// R×R×R uint8 (z, y, x). Throws std::invalid_argument without views, or for a mask or depth that is not H×W.
Tensor visual_hull(const FieldGeometry& geometry, const std::vector<MaskView>& views, const HullOptions& options = {});

// The votes themselves: for every cell the share of the views that see it and agree; −1 where fewer than min_views do.
Tensor hull_votes(const FieldGeometry& geometry, const std::vector<MaskView>& views, const HullOptions& options = {});

}  // namespace fieldgraft
