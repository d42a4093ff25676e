// What rays pass through before the edit at hand: f and the edits below it as one medium, sampled without gradients.
//
// Level n of a stack sees the level below as one medium (Blending-NeRF's blend applied repeatedly):
//   σ⁽ⁿ⁾ = (1 − βσ) σ + σᵉ      c⁽ⁿ⁾ = ((1 − βσ) σ ((1 − βc) c + βc cᵉ) + σᵉ cᵉ)/σ⁽ⁿ⁾      (σ, c of level n − 1)
// the conserving mixture, exactly (σ, c) where g is 0. Strengths scale σᵉ, βσ, βc; a head of strength 0 does not exist.
//
// Marching: f's occupied cells, plus the cells where an edit may add density (there σ of f is 0). Samples behind
// transmittance march.min_transmittance are left out; what an edit may remove hides nothing, so that what it uncovers
// is there. Nothing here is differentiable. Lengths in model units; colours carry no background.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "core/field/edit_field.h"
#include "core/render/blend.h"
#include "core/render/march.h"

namespace fieldgraft {

// An edit in a stack, lowest first.
struct StackItem {
    std::shared_ptr<const EditField> field;
    float add = 1, remove = 1, change = 1;  // strengths, in [0, 1]

    // The operations that do anything: g's, less those of strength 0.
    Operations active() const;
};
using EditStack = std::vector<StackItem>;

StackItem stack_item(const EditFile& edit);
// Throws std::invalid_argument: no field, strengths outside [0, 1], a box that is not f's.
void check_stack(const RadianceField& field, const EditStack& stack);
// The items that do anything.
EditStack active_items(const EditStack& stack);

// g at the positions (N×3), times the strengths; heads of strength 0 are undefined. Differentiable in g.
EditSamples evaluate(const StackItem& item, const Tensor& positions);

struct Medium {
    Tensor density;  // N
    Tensor color;    // N×3
};
// The next level's medium.
Medium blended_medium(const Medium& below, const EditSamples& edit);

// Colours of f's samples in place of RadianceField::color (features N×F, positions N×3, directions N×3 → N×3).
using SampleColor = std::function<Tensor(const Tensor& features, const Tensor& positions, const Tensor& directions)>;

struct MediumOptions {
    MarchOptions march;
    bool keep_hidden =
        false;          // keep samples no light comes from (colour 0): `removed` as the paper has it sums over them
    SampleColor color;  // none: f's own
};

// Where the items may add and where they may take away, for sample_visible. An item without support acts everywhere.
EditCells edit_cells(const EditStack& items);

struct MediumSamples {
    Samples samples;
    Tensor density, color;  // N, N×3, no gradient
};

// f alone, at samples that include all that the items may add and may uncover.
MediumSamples sample_stack(const RadianceField& field, const EditStack& items, const RayBundle& rays,
                           const MediumOptions& options);

}  // namespace fieldgraft
