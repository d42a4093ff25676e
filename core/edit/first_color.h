// The colour that g starts with: of a palette, the one the guide likes best when all that may be edited is painted in
// it.
//
// What a guide thinks of colours has hills of its own: from grey, "a red ball" led a small guide to mint as often as to
// red, because a mint ball looked more like a ball than a grey one. So g does not start grey: the text losses are
// evaluated, without gradients, for every colour of the palette, with what may be added opaque and what may be changed
// changed whole.
#pragma once

#include <array>
#include <vector>

#include "core/edit/edit_plan.h"
#include "core/edit/edit_render.h"
#include "core/edit/text_objective.h"

namespace fieldgraft {

// Image values (sRGB-encoded), each in (0, 1): 3 levels a channel.
std::vector<std::array<float, 3>> first_color_palette();

// The palette's colour with the least text loss, summed over the patches; the same augmentations for every colour.
// `edge`: the box's longest, model units.
std::array<float, 3> best_first_color(const std::vector<FrozenPatch>& patches, const TextObjective& text,
                                      const EditSpec& spec, const EditPlan& plan, double edge, const Random& random);

}  // namespace fieldgraft
