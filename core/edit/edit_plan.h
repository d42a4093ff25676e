// The edit plan: exactly the heads, images, maps and loss terms that an edit's operations and weights need.
//
// Compiled once from the specification; the loop asks the plan, never the operations, so that what is off does not
// exist (Blending-NeRF, sec. 4; no head, parameter, branch, loss term or map for an operation that is off). Shown by
// `info` and sent as the first event of an edit.
#pragma once

#include <string>
#include <vector>

#include "core/edit/edit_spec.h"

namespace fieldgraft {

struct LossTerm {
    std::string name;
    double weight = 0;
};

struct EditPlan {
    Operations operations;
    std::vector<std::string> heads;  // density_e, color_e, beta_density, beta_color
    std::vector<std::string> maps;   // added, removed, changed
    std::vector<LossTerm> terms;     // weight > 0 and possible with these operations
    bool edit_image = false;         // Iᵉ is rendered (global_edit is on and there is a color_e)
    bool march_region = false;       // rays also visit where density may be added
    bool geometry_fixed = false;     // σᵝ = σᵒ: samples and transmittances are f's own
    bool segmenter_per_view = false, region_grid = false;
    double positive_weight_floor = 1;  // λ₊: at least 30 with add

    static EditPlan compile(const EditSpec& spec);
    bool has(const std::string& term) const;
    double weight(const std::string& term) const;  // 0 for a term that is off
    Json to_json() const;
};

}  // namespace fieldgraft
