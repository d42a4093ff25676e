#include "core/field/geometry.h"

#include <cmath>

#include "core/base/errors.h"

namespace fieldgraft {
namespace {

template <std::size_t n>
void read_numbers(const Json& json, const char* key, std::array<double, n>& out) {
    const auto found = json.find(key);
    if (found == json.end() || !found->is_array() || found->size() != n) {
        input_error("geometry: \"{}\" must be a list of {} numbers", key, n);
    }
    for (std::size_t i = 0; i < n; ++i) {
        const Json& item = (*found)[i];
        if (!item.is_number() || !std::isfinite(item.get<double>())) {
            input_error("geometry: \"{}\"[{}] must be a finite number, not {}", key, i, item.dump());
        }
        out[i] = item.get<double>();
    }
}

double read_positive(const Json& json, const char* key) {
    const auto found = json.find(key);
    if (found == json.end() || !found->is_number() || !(found->get<double>() > 0)) {
        input_error("geometry: \"{}\" must be a positive number", key);
    }
    return found->get<double>();
}

double read_number(const Json& json, const char* key) {
    const auto found = json.find(key);
    if (found == json.end() || !found->is_number()) input_error("geometry: \"{}\" must be a number", key);
    return found->get<double>();
}

bool read_flag(const Json& json, const char* key) {
    const auto found = json.find(key);
    if (found == json.end() || !found->is_boolean()) input_error("geometry: \"{}\" must be true or false", key);
    return found->get<bool>();
}

}  // namespace

Json FieldGeometry::to_json() const {
    Json json{{"box_min", box_min},
              {"box_max", box_max},
              {"frame", frame},
              {"up", up},
              {"centre", centre},
              {"radius_range", radius_range},
              {"image_width", image_width},
              {"image_height", image_height},
              {"focal_x", focal_x},
              {"focal_y", focal_y},
              {"principal_x", principal_x},
              {"principal_y", principal_y},
              {"white_background", white_background},
              {"forward_facing", forward_facing}};
    // Only where it says something: a field's hash, which its edits know, is over this.
    if (background != FieldGeometry().background) json["background"] = background;
    return json;
}

FieldGeometry FieldGeometry::from_json(const Json& json) {
    if (!json.is_object()) input_error("geometry: must be a JSON object");
    FieldGeometry geometry;
    read_numbers(json, "box_min", geometry.box_min);
    read_numbers(json, "box_max", geometry.box_max);
    for (int c = 0; c < 3; ++c) {
        if (!(geometry.box_min[c] < geometry.box_max[c])) input_error("geometry: the box is empty along axis {}", c);
    }
    read_numbers(json, "frame", geometry.frame);
    read_numbers(json, "up", geometry.up);
    read_numbers(json, "centre", geometry.centre);
    read_numbers(json, "radius_range", geometry.radius_range);
    geometry.image_width = static_cast<int>(read_positive(json, "image_width"));
    geometry.image_height = static_cast<int>(read_positive(json, "image_height"));
    geometry.focal_x = read_positive(json, "focal_x");
    geometry.focal_y = read_positive(json, "focal_y");
    geometry.principal_x = read_number(json, "principal_x");
    geometry.principal_y = read_number(json, "principal_y");
    geometry.white_background = read_flag(json, "white_background");
    geometry.forward_facing = read_flag(json, "forward_facing");
    if (json.contains("background")) read_numbers(json, "background", geometry.background);
    return geometry;
}

}  // namespace fieldgraft
