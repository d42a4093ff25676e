// Where an edit acts, in three dimensions: found before training out of many views that must agree.
//
// Survey views of the base are rendered and segmented; every pixel votes at the points it shows, and the votes of all
// views are fused in a grid (vote_grid.h). Masks the user has drawn in views of the scene vote likewise, five times as
// strongly, so that they act from every camera. One view's wrong mask is outvoted, and every training view then sees
// the same region.
//
//   score    R×R×R float: share of the votes that call a cell part of the region, scaled so that ½ is its border
//   volume   cells that density may be added to (operation add): around the region, by the agreement of the views'
//            dilated regions (a cell counts when most views that see it say so), or above the region's top
//   confine  cells outside which g is 0 altogether: the region grown by the dilations, and the volume
//
// Grids are R×R×R (z, y, x) over the field's box. Nothing here is differentiable.
#pragma once

#include "core/base/progress.h"
#include "core/edit/base_medium.h"
#include "core/edit/edit_cameras.h"
#include "core/edit/edit_plan.h"
#include "core/guidance/guidance.h"
#include "core/scene/scene.h"

namespace fieldgraft {

struct EditRegion {
    Tensor score;            // undefined where regions are found per view
    Tensor volume, confine;  // uint8; undefined: no add; not confined
    bool on_surface = true;  // M is what shows the region (and the volume, with add); else the volume alone
    double share = 0;        // of the object's pixels in the survey views that were called the region
    Vec3 centre{0, 0, 0};    // of the base's matter

    std::map<std::string, Tensor> tensors() const;  // for a checkpoint
    static EditRegion restore(const std::map<std::string, Tensor>& tensors, const Json& json);
    Json to_json() const;
};

// The cells where a trained edit may turn out to act: matter of the base, and where density may be added; R that of the
// base's occupancy.
Tensor support_candidates(const Operations& operations, const BaseMedium& base, const EditRegion& region);

// Throws InputError when the segmenter finds nothing of the text in any view, or a mask does not fit its view.
EditRegion find_region(const BaseMedium& base, Guidance& guide, const EditSpec& spec, const EditPlan& plan,
                       const EditCameras& cameras, const Scene* scene, const Reporter& reporter);

}  // namespace fieldgraft
