#include "core/edit/plan_cost.h"

namespace fieldgraft {
namespace {

constexpr int corners = 8, floats = 4;  // of a cell; bytes of a number

// Numbers a sample that the heads hold.
int outputs_of(const Operations& on) {
    return (on.add ? 1 : 0) + (on.add || on.change ? 3 : 0) + (on.remove ? 1 : 0) + (on.change ? 1 : 0);
}

}  // namespace

PlanCost cost_of(const EditFieldConfig& config, const EditPlan& plan) {
    PlanCost cost;
    const EditField g(config, FieldGeometry(), 0);
    for (const auto& [name, parameter] : g.parameters()) cost.parameters += parameter.numel();
    cost.state_bytes = 4 * floats * cost.parameters;

    const std::int64_t levels = static_cast<std::int64_t>(config.resolutions.size());
    const std::int64_t encoded = levels * config.features_per_level, hidden = config.hidden;
    const std::int64_t outputs = outputs_of(config.operations);
    const std::int64_t interpolation = corners * encoded, first = encoded * hidden, last = hidden * outputs;
    cost.drawing_operations = 2 * (interpolation + first + last);
    cost.training_operations = 2 * (2 * interpolation + 4 * first + 3 * last);

    // σ, δ and colour of the frozen medium, the position, and which sample it is.
    constexpr std::int64_t medium = floats * (1 + 1 + 3 + 3) + 8;
    const std::int64_t looked_up = floats * corners * encoded, row = floats * encoded, heads = floats * outputs;
    cost.drawing_bytes = medium + looked_up + 2 * row + 2 * heads;
    // Backward: the medium and the row again, gradients of heads and row written and read, entries read and written.
    cost.training_bytes = cost.drawing_bytes + medium + row + 2 * heads + 2 * row + 2 * looked_up;
    // Iᵒ forward; Iᵝ and Iᵉ forward and backward.
    cost.tower_passes = 1 + 2 + (plan.edit_image ? 2 : 0);
    return cost;
}

Json PlanCost::to_json() const {
    return {{"parameters", parameters},
            {"state_bytes", state_bytes},
            {"operations_a_sample", {{"training", training_operations}, {"drawing", drawing_operations}}},
            {"bytes_a_sample", {{"training", training_bytes}, {"drawing", drawing_bytes}}},
            {"tower_passes", tower_passes}};
}

std::vector<LeftOut> left_out(const EditSpec& spec, const EditPlan& plan) {
    const Operations& on = plan.operations;
    std::vector<LeftOut> out;
    const auto leave = [&](bool skipped, const char* what, const std::string& why) {
        if (skipped) out.push_back({what, why});
    };
    leave(!on.add, "density of g, its map and entropy, samples in empty space", "nothing is added");
    leave(!on.remove, "beta of the density and its map, samples behind what may go", "nothing is removed");
    leave(!on.change, "beta of the colour and its map", "nothing is recoloured");
    leave(!on.add && !on.change, "colour of g, its picture",
          "neither added nor recoloured: there is no colour of its own");
    leave(plan.geometry_fixed, "densities and transmittances of the blend while training", "they are the field's own");
    leave((on.add || on.change) && !plan.edit_image, "the picture of g alone and its two passes through the tower",
          spec.weight("global_edit") > 0 ? "the target names no thing of its own (\"… with …\")"
                                         : "the weight global_edit is 0");
    leave(!plan.segmenter_per_view, "the segmenter while training",
          spec.region_source == RegionSource::masks ? "masks alone say where"
                                                    : "the region is found once, before the first iteration");
    leave(true, "the text tower while training", "prompts are embedded before the first iteration");
    leave(true, "the view direction in g", "edits look the same from everywhere, as a bake shows them");
    for (const std::string& name : EditSpec::known_weights()) {
        if (name == "inside" || name == "global_edit" || plan.has(name)) continue;
        out.push_back(
            {"the loss " + name, spec.weight(name) > 0 ? "these operations do not have it" : "its weight is 0"});
    }
    return out;
}

}  // namespace fieldgraft
