// How much an edit changed and how well it matches the text (Blending-NeRF, sec. 5.2).
//
//   D_L1     mean |Iᵝ − Iᵒ| over pixels and channels, of the whole picture, inside and outside a region, and outside it
//            over the object's pixels only (not the background around them, which would flatter any edit)
//   S_CLIP   mean of the CLIP similarity cos(E(Iᵝ), E(T_target)) and the directional similarity
//            cos(E(Iᵝ) − E(Iᵒ), E(T_target) − E(T_source)), embeddings brought to length 1 first
//   MP_CLIP  (1 − D_L1) · S_CLIP
// The judge must be another model than the one that guided the edit. Images are H×W×3 in [0, 1]; nothing is
// differentiable.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/base/json.h"
#include "core/guidance/guidance.h"

namespace fieldgraft {

struct EditedView {
    Tensor original, edited;  // H×W×3, over the same background
    Tensor object;            // H×W bool: pixels where there is an object (opacity > ½); undefined: all
    Tensor region;            // H×W bool: where the edit should act; undefined: not known
};

struct EditMetrics {
    double d_l1 = 0;
    double d_l1_inside = 0, d_l1_outside = 0, d_l1_outside_object = 0;  // NaN without a region (or without such pixels)
    double s_clip = 0, similarity = 0, directional = 0, mp_clip = 0;    // NaN without a judge

    Json to_json() const;  // NaN entries are left out
};

// |a − b| averaged over channels and the pixels of `mask` (undefined: all); NaN for an empty mask.
double mean_change(const Tensor& original, const Tensor& edited, const Tensor& mask);
// Pixels of all views weigh the same. judge may be null.
EditMetrics measure_edit(const std::vector<EditedView>& views, Guidance* judge, const std::string& source,
                         const std::string& target);

}  // namespace fieldgraft
