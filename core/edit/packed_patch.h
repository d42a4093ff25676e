// A training view as it waits in the pool to be seen again: 19 bytes a sample instead of 48.
//
// Positions are kept as distances along their rays, colours in half precision (2⁻¹¹ relative: less than what a picture
// of 8 bits tells apart), which samples g acts on as bytes. Packing what was unpacked changes nothing but distances,
// by rounding.
#pragma once

#include "core/edit/frozen_patch.h"
#include "core/render/samples.h"

namespace fieldgraft {

class PackedPatch {
  public:
    PackedPatch() = default;
    // `rays` are the patch's S² rays, directions of length 1.
    PackedPatch(const FrozenPatch& patch, const RayBundle& rays);
    FrozenPatch unpacked() const;
    std::size_t bytes() const;

  private:
    FrozenPatch rest_;  // without positions, colours and `acting`
    RayBundle rays_;
    Tensor t_, color_, acts_;  // N float32, N×3 float16, N bool
};

}  // namespace fieldgraft
