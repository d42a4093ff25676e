// One iteration's losses: the guide's through the pictures, the localised ones through the maps (Blending-NeRF,
// sec. 4.2, 4.3).
//
// `position` is where the run is in the schedule, in nominal iterations. The text losses are differentiated down to the
// pictures first, by themselves (so the towers' time is known and their graph is gone), then everything at once down to
// g.
#pragma once

#include "core/edit/edit_plan.h"
#include "core/edit/edit_render.h"
#include "core/edit/text_objective.h"

namespace fieldgraft {

struct StepLosses {
    double total = 0, tower_seconds = 0;
    std::map<std::string, double> terms;  // unweighted, those that are on
};

// Leaves gradients in g's parameters.
StepLosses backward_step(const EditField& edit, const FrozenPatch& patch, const TextObjective& text,
                         const EditSpec& spec, const EditPlan& plan, double position, Random& random);

// The background of an iteration, 3 colours.
Tensor draw_background(EditBackground kind, Random& random);
// The thresholds at this position: a share of the frame, whatever the specification states them relative to.
double threshold_of(const std::string& map, const EditSpec& spec, double position, double region_share);

}  // namespace fieldgraft
