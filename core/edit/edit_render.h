// The differentiable part of an iteration: g along a frozen patch, blended with it (Blending-NeRF, eqs. 4–7).
//
// Images are S×S×3 over one background colour: Iᵝ = Cᵝ + T·b, Iᵉ = Cᵉ + (1 − A)·b with Iᵉ's own accumulated weight A;
// maps S×S. g is evaluated at the patch's acting samples only and is exactly 0 at the others. Gradients reach g's
// parameters through blend(); the stop-gradients of the maps are the renderer's.
#pragma once

#include "core/base/random.h"
#include "core/edit/edit_plan.h"
#include "core/edit/frozen_patch.h"
#include "core/render/blend.h"

namespace fieldgraft {

struct RenderedEdit {
    Tensor blended, edit;            // S×S×3; edit undefined when the plan has no Iᵉ
    Tensor added, removed, changed;  // S×S; undefined when the operation is off

    Tensor map_sum() const;
};

RenderedEdit render_edit(const EditField& edit, const FrozenPatch& patch, const EditPlan& plan,
                         const BlendOptions& options, const Tensor& background);
// The same for values of g that are already known at all samples of the patch.
RenderedEdit render_samples(const EditSamples& g, const FrozenPatch& patch, const EditPlan& plan,
                            const BlendOptions& options, const Tensor& background);

// The jitter penalty of g at up to `count` of the patch's acting samples, `distance` in model units
// (field/edit_support.h). Keeps colours even where the text is silent.
Tensor smoothness_loss(const EditField& edit, const FrozenPatch& patch, double distance, int count, Random& random);

}  // namespace fieldgraft
