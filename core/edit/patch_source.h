// Where an edit's training views come from: patches of the base (frozen_patch.h) under drawn cameras, and their masks.
//
// A training patch depends on the seed and its own number only, so that a pool of patches can be kept, dropped and made
// again, and a resumed run sees the same ones.
//
// Masks: with a fused region, a pixel is in M where more than half of what it shows lies in the region's cells, or
// where it looks into cells that density may be added to. With RegionFusion::view, M is the segmenter's own for this
// picture.
#pragma once

#include <map>

#include "core/edit/base_medium.h"
#include "core/edit/edit_cameras.h"
#include "core/edit/edit_plan.h"
#include "core/edit/packed_patch.h"
#include "core/edit/region_finder.h"

namespace fieldgraft {

class PatchSource {
  public:
    // `region` and `guide` must outlive the source. spec.camera_pool patches are kept, at most 1.5 GB of them: the
    // one unused for longest goes first.
    PatchSource(const BaseMedium& base, const EditCameras& cameras, const EditSpec& spec, const EditPlan& plan,
                const EditRegion& region, Guidance& guide);

    // Training patch `number`: the same for the same seed and number.
    FrozenPatch patch(std::uint64_t number);
    // The whole view as size×size pixels, with fused masks (none where regions are found per view).
    FrozenPatch view(const Camera& camera, int size) const;

  private:
    struct Kept {
        PackedPatch patch;
        std::uint64_t used;  // when, in calls
    };
    FrozenPatch make(const RayBundle& rays, int size, bool per_view_mask) const;
    Tensor region_mask(const Samples& samples, const FrozenPatch& patch, const Tensor& weight) const;
    void keep(std::uint64_t number, PackedPatch patch);

    const BaseMedium& base_;
    const EditCameras& cameras_;
    EditSpec spec_;
    EditPlan plan_;
    const EditRegion& region_;
    Guidance& guide_;
    std::map<std::uint64_t, Kept> kept_;
    std::size_t kept_bytes_ = 0;
    std::uint64_t calls_ = 0;
};

}  // namespace fieldgraft
