// EditSpec ↔ JSON. One table of fields serves both directions, so that they cannot drift apart.
#include <set>

#include "core/base/errors.h"
#include "core/edit/edit_spec.h"

namespace fieldgraft {

NLOHMANN_JSON_SERIALIZE_ENUM(RegionSource, {{RegionSource::segmenter, "segmenter"},
                                            {RegionSource::masks, "masks"},
                                            {RegionSource::both, "both"}})
NLOHMANN_JSON_SERIALIZE_ENUM(RegionFusion, {{RegionFusion::fused, "fused"}, {RegionFusion::view, "view"}})
NLOHMANN_JSON_SERIALIZE_ENUM(Placement, {{Placement::automatic, "automatic"},
                                         {Placement::around, "around"},
                                         {Placement::above, "above"}})
NLOHMANN_JSON_SERIALIZE_ENUM(EditBackground, {{EditBackground::white, "white"},
                                              {EditBackground::black, "black"},
                                              {EditBackground::random, "random"}})
NLOHMANN_JSON_SERIALIZE_ENUM(Compositing, {{Compositing::paper, "paper"}, {Compositing::conserving, "conserving"}})
NLOHMANN_JSON_SERIALIZE_ENUM(RemovedMap, {{RemovedMap::paper, "paper"}, {RemovedMap::visible, "visible"}})

namespace {

// Calls visit(name, member) for every plain member of the specification.
template <class Spec, class Visit>
void visit_fields(Spec& s, Visit&& visit) {
    visit("source", s.source);
    visit("target", s.target);
    visit("region_text", s.region_text);
    visit("tau_add", s.tau.add);
    visit("tau_remove", s.tau.remove);
    visit("tau_change", s.tau.change);
    visit("tau_add_start", s.tau.add_start);
    visit("tau_change_start", s.tau.change_start);
    visit("tau_anneal_iterations", s.tau.anneal_iterations);
    visit("tau_relative_to_region", s.tau.relative_to_region);
    visit("dilation", s.dilation);
    visit("region_source", s.region_source);
    visit("region_fusion", s.region_fusion);
    visit("placement", s.placement);
    visit("addition_alone", s.addition_alone);
    visit("confine", s.confine);
    visit("region_views", s.region_views);
    visit("reg_from", s.reg_from);
    visit("patch", s.patch);
    visit("augmentations", s.augmentations);
    visit("zoom", s.zoom);
    visit("camera_pool", s.camera_pool);
    visit("background", s.background);
    visit("compositing", s.compositing);
    visit("removed", s.removed);
    visit("resolutions", s.resolutions);
    visit("seek_first_color", s.seek_first_color);
    visit("fade_levels", s.fade_levels);
    visit("learning_rate", s.learning_rate);
    visit("learning_rate_end", s.learning_rate_end);
    visit("learning_rate_iterations", s.learning_rate_iterations);
    visit("nominal_iterations", s.nominal_iterations);
    visit("iterations", s.iterations);
    visit("minutes", s.minutes);
    visit("quality", s.quality);
    visit("seed", s.seed);
}

// Enumerations come back as their first value for an unknown word: compare what was read with what was written.
template <class T>
void read_value(const std::string& name, const Json& json, T& value) {
    try {
        value = json.get<T>();
    } catch (const Json::exception&) {
        input_error("edit specification: \"{}\" has the wrong type: {}", name, json.dump());
    }
    if constexpr (std::is_enum_v<T>) {
        if (Json(value) != json) input_error("edit specification: \"{}\" cannot be {}", name, json.dump());
    }
}

}  // namespace

Json EditSpec::to_json() const {
    Json json;
    json["preset"] = preset;
    json["operations"] = operations.any() ? operations.to_string() : std::string();
    visit_fields(*this, [&](const char* name, const auto& value) { json[name] = value; });
    json["weights"] = weights;
    json["masks"] = Json::array();
    for (const UserMask& mask : masks) json["masks"].push_back({{"view", mask.view}, {"file", mask.file}});
    return json;
}

EditSpec EditSpec::from_json(const Json& json) {
    if (!json.is_object()) input_error("edit specification: an object is expected, not {}", json.type_name());
    const std::string operations = json.value("operations", std::string());
    if (operations.empty()) input_error("edit specification: \"operations\" is missing; give e.g. \"change,add\"");
    EditSpec spec = from_preset(json.value("preset", std::string("builtin")), Operations::parse(operations));
    std::set<std::string> known{"preset", "operations", "weights", "masks"};
    visit_fields(spec, [&](const char* name, auto& value) {
        known.insert(name);
        if (json.contains(name)) read_value(name, json.at(name), value);
    });
    for (const auto& [name, value] : json.items())
        if (!known.contains(name)) input_error("edit specification: there is no \"{}\"", name);
    const Json weights = json.value("weights", Json::object());
    for (const auto& [name, value] : weights.items()) {
        double number = 0;
        read_value("weights." + name, value, number);
        spec.set_weight(name, number);
    }
    for (const Json& mask : json.value("masks", Json::array())) {
        if (!mask.contains("view") || !mask.contains("file"))
            input_error("edit specification: a mask needs \"view\" and \"file\", not {}", mask.dump());
        UserMask read;
        read_value("masks.view", mask.at("view"), read.view);
        read_value("masks.file", mask.at("file"), read.file);
        spec.masks.push_back(read);
    }
    return spec;
}

}  // namespace fieldgraft
