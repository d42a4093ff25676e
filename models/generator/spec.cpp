#include "models/generator/spec.h"

#include <nlohmann/json.hpp>

#include "models/generator/shapes.h"
#include "models/generator/vocabulary.h"

namespace fieldgraft::generator {
namespace {

using Json = nlohmann::ordered_json;

Json colour_json(int colour) {
    return colour < 0 ? Json(nullptr) : Json(std::string(colour_name(colour)));
}

Json object_json(const ObjectSpec& o) {
    static const char* const kRoles[] = {"main", "copy", "second", "addition", "clutter"};
    Json json = {{"role", kRoles[static_cast<int>(o.role)]},
                 {"shape", std::string(shape_info(o.shape).name)},
                 {"material", std::string(material_name(o.material))},
                 {"colour", colour_json(o.colour)},
                 {"second_colour", colour_json(o.colour2)},
                 {"lightness", o.lightness},
                 {"seed", o.seed},
                 {"position", {o.position.x, o.position.y, o.position.z}},
                 {"yaw", o.yaw},
                 {"tilt", o.tilt},
                 {"size", o.size},
                 {"parts", Json::object()},
                 {"absent", Json::array()}};
    for (const PartPaint& p : o.paints) json["parts"][std::string(part_name(p.part))] = colour_json(p.colour);
    for (const int part : o.absent) json["absent"].push_back(std::string(part_name(part)));
    return json;
}

}  // namespace

std::string to_json(const SceneSpec& spec) {
    static const char* const kKinds[] = {"none", "plate", "disc", "plane"};
    static const char* const kStuffs[] = {"colour", "wood", "marble", "brick", "grass", "snow", "checkered", "beige"};
    static const char* const kBackdrops[] = {"white", "colour", "gradient", "noise"};
    Json json = {{"objects", Json::array()}};
    for (const ObjectSpec& o : spec.objects) json["objects"].push_back(object_json(o));
    const bool none = spec.ground.kind == GroundKind::kNone;
    json["ground"] = {{"kind", kKinds[static_cast<int>(spec.ground.kind)]}};
    if (!none) {
        json["ground"]["stuff"] = kStuffs[static_cast<int>(spec.ground.stuff)];
        json["ground"]["colour"] = colour_json(spec.ground.stuff == GroundStuff::kColour ? spec.ground.colour : -1);
        json["ground"]["size"] = spec.ground.size;
        json["ground"]["seed"] = spec.ground.seed;
    }
    json["backdrop"] = {{"kind", kBackdrops[static_cast<int>(spec.backdrop.kind)]},
                        {"colour", colour_json(spec.backdrop.colour)},
                        {"seed", spec.backdrop.seed}};
    json["view_seed"] = spec.view_seed;
    return json.dump();
}

}  // namespace fieldgraft::generator
