#include "core/edit/edit_plan.h"

namespace fieldgraft {

namespace {

bool possible(const std::string& term, const EditSpec& spec) {
    const Operations& on = spec.operations;
    if (term == "global_edit") return (on.add || on.change) && !spec.edit_text().empty();  // no colour head, no Iᵉ
    if (term == "reg") return on.add;                                                      // entropy of E_add
    if (term == "inside") return false;  // a part of `region`, not a term of its own
    return true;
}

}  // namespace

EditPlan EditPlan::compile(const EditSpec& spec) {
    const Operations& on = spec.operations;
    EditPlan plan;
    plan.operations = on;
    if (on.add) plan.heads.push_back("density_e"), plan.maps.push_back("added");
    if (on.add || on.change) plan.heads.push_back("color_e");
    if (on.remove) plan.heads.push_back("beta_density"), plan.maps.push_back("removed");
    if (on.change) plan.heads.push_back("beta_color"), plan.maps.push_back("changed");
    for (const std::string& name : EditSpec::known_weights())
        if (spec.weight(name) > 0 && possible(name, spec)) plan.terms.push_back({name, spec.weight(name)});
    plan.edit_image = plan.has("global_edit");
    plan.march_region = on.add;
    plan.geometry_fixed = on.change && !on.add && !on.remove;
    plan.region_grid = spec.region_fusion == RegionFusion::fused || on.add || !spec.masks.empty();
    plan.segmenter_per_view = spec.region_fusion == RegionFusion::view && spec.region_source != RegionSource::masks;
    plan.positive_weight_floor = on.add ? 30 : 1;
    return plan;
}

bool EditPlan::has(const std::string& term) const {
    return weight(term) > 0;
}

double EditPlan::weight(const std::string& term) const {
    for (const LossTerm& candidate : terms)
        if (candidate.name == term) return candidate.weight;
    return 0;
}

Json EditPlan::to_json() const {
    Json losses = Json::object();
    for (const LossTerm& term : terms) losses[term.name] = term.weight;
    return {{"operations", operations.to_string()},
            {"heads", heads},
            {"maps", maps},
            {"losses", losses},
            {"edit_image", edit_image},
            {"march_region", march_region},
            {"geometry_fixed", geometry_fixed},
            {"region", segmenter_per_view ? "view"
                       : region_grid      ? "fused"
                                          : "none"}};
}

}  // namespace fieldgraft
