#include "models/generator/settings.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>
#include <vector>

namespace fieldgraft::generator {
namespace {

struct Entry {
    const char* name;
    float Settings::*member;
    float low, high;
};

const std::vector<Entry>& entries() {
    static const std::vector<Entry> list = {
        {"white_backdrop", &Settings::white_backdrop, 0, 1},
        {"no_ground", &Settings::no_ground, 0, 1},
        {"base_plate", &Settings::base_plate, 0, 1},
        {"endless_plane", &Settings::endless_plane, 0, 1},
        {"plain", &Settings::plain, 0, 1},
        {"own_part_colours", &Settings::own_part_colours, 0, 1},
        {"addition", &Settings::addition, 0, 1},
        {"second_object", &Settings::second_object, 0, 1},
        {"several", &Settings::several, 0, 1},
        {"clutter", &Settings::clutter, 0, 1},
        {"alike", &Settings::alike, 0, 1},
        {"primitive_tumbles", &Settings::primitive_tumbles, 0, 1},
        {"stated_share", &Settings::stated_share, 0, 1},
        {"say_ground", &Settings::say_ground, 0, 1},
        {"say_part", &Settings::say_part, 0, 1},
        {"synonym", &Settings::synonym, 0, 1},
        {"bare", &Settings::bare, 0, 1},
        {"prefix", &Settings::prefix, 0, 1},
        {"shape_for_shape", &Settings::shape_for_shape, 0, 1},
        {"elevation_min", &Settings::elevation_min, -20, 89},
        {"elevation_max", &Settings::elevation_max, -20, 89},
        {"fov_min", &Settings::fov_min, 5, 100},
        {"fov_max", &Settings::fov_max, 5, 100},
        {"frame_min", &Settings::frame_min, 0.1f, 2},
        {"frame_max", &Settings::frame_max, 0.1f, 2},
        {"cropped", &Settings::cropped, 0, 1},
        {"shadows", &Settings::shadows, 0, 1},
        {"blurred", &Settings::blurred, 0, 1},
        {"grainy", &Settings::grainy, 0, 1},
    };
    return list;
}

constexpr const char* kChangeNames[] = {"colour", "material", "shape", "addition", "removal", "ground", "part_paint"};

float checked(const nlohmann::json& value, const std::string& name, float low, float high) {
    if (!value.is_number()) throw std::invalid_argument("generator settings: \"" + name + "\" is not a number");
    const float x = value.get<float>();
    if (!(x >= low && x <= high)) {
        throw std::invalid_argument("generator settings: \"" + name + "\" is " + std::to_string(x) + ", not within " +
                                    std::to_string(low) + " to " + std::to_string(high));
    }
    return x;
}

// As it would be written by hand: 0.42, not 0.41999998688697815.
double decimal(float x) {
    return std::round(static_cast<double>(x) * 1e5) / 1e5;
}

void read_changes(const nlohmann::json& object, Settings& settings) {
    for (const auto& [key, value] : object.items()) {
        bool known = false;
        for (size_t i = 0; i < settings.change.size(); ++i) {
            if (key != kChangeNames[i]) continue;
            settings.change[i] = checked(value, "change." + key, 0, 1e3f);
            known = true;
        }
        if (!known) throw std::invalid_argument("generator settings: there is no change \"" + key + "\"");
    }
    float sum = 0;
    for (const float weight : settings.change) sum += weight;
    if (sum <= 0) throw std::invalid_argument("generator settings: all weights in \"change\" are 0");
}

}  // namespace

Settings settings_from_json(std::string_view text) {
    Settings settings;
    if (text.empty()) return settings;
    nlohmann::json json;
    try {
        json = nlohmann::json::parse(text);
    } catch (const nlohmann::json::exception& error) {
        throw std::invalid_argument(std::string("generator settings: not JSON: ") + error.what());
    }
    if (!json.is_object()) throw std::invalid_argument("generator settings: not a JSON object");
    for (const auto& [key, value] : json.items()) {
        if (key == "change" && value.is_object()) {
            read_changes(value, settings);
            continue;
        }
        bool known = false;
        for (const Entry& e : entries()) {
            if (key != e.name) continue;
            settings.*(e.member) = checked(value, key, e.low, e.high);
            known = true;
        }
        if (!known) throw std::invalid_argument("generator settings: there is no setting \"" + key + "\"");
    }
    for (const auto& [lo, hi] :
         {std::pair{settings.elevation_min, settings.elevation_max}, std::pair{settings.fov_min, settings.fov_max},
          std::pair{settings.frame_min, settings.frame_max}}) {
        if (lo > hi)
            throw std::invalid_argument("generator settings: a minimum of " + std::to_string(lo) +
                                        " is above its maximum of " + std::to_string(hi));
    }
    return settings;
}

std::string to_json(const Settings& settings) {
    nlohmann::ordered_json json;
    for (const Entry& e : entries()) json[e.name] = decimal(settings.*(e.member));
    for (size_t i = 0; i < settings.change.size(); ++i) json["change"][kChangeNames[i]] = decimal(settings.change[i]);
    return json.dump(2);
}

}  // namespace fieldgraft::generator
