// What an edit's plan costs, counted from its shapes, and what it leaves out and why: what `info EDIT` shows.
//
// Counts are of g and of blending it, a sample of a training step (forward and backward) or of a picture (forward):
//   operations  two for every product of the encoding's interpolation and of the network, three passes in training and
//               the hidden layer once more (it is computed again in the backward pass)
//   bytes       what is read and written of arrays of samples (the frozen medium, rows of the encoding, heads, and
//               their gradients); the tables are counted as what is looked up
#pragma once

#include <string>
#include <vector>

#include "core/edit/edit_plan.h"

namespace fieldgraft {

struct PlanCost {
    std::int64_t parameters = 0;
    std::int64_t state_bytes = 0;  // parameters, their gradients and Adam's two moments, float32
    std::int64_t training_operations = 0, drawing_operations = 0;  // a sample
    std::int64_t training_bytes = 0, drawing_bytes = 0;            // a sample
    int tower_passes = 0;  // of a batch of augmented pictures through the image tower an iteration, backward ones too
    Json to_json() const;
};
PlanCost cost_of(const EditFieldConfig& config, const EditPlan& plan);

struct LeftOut {
    std::string what, why;
};
// What other edits compute and this one does not.
std::vector<LeftOut> left_out(const EditSpec& spec, const EditPlan& plan);

}  // namespace fieldgraft
