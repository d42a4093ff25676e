// What the generator draws from: probabilities in [0, 1] and ranges. JSON in and out is one flat object; a key that
// is left out keeps its default, an unknown key or a value out of range is an error (std::invalid_argument).
#pragma once

#include <array>
#include <string>
#include <string_view>

namespace fieldgraft::generator {

struct Settings {
    // Ground and backdrop.
    float white_backdrop = 0.75f;  // else a colour, a gradient or noise
    float no_ground = 0.5f;
    float base_plate = 0.2f;  // of all pictures; the rest is split into discs and endless planes
    float endless_plane = 0.18f;
    // Objects.
    float plain = 0.42f;            // no material word
    float own_part_colours = 1.0f;  // scales each part's own chance
    float addition = 0.12f, second_object = 0.12f, several = 0.05f;
    float clutter = 0.35f;
    float alike = 0.0f;  // second objects and clutter in the main object's colour, as far as combinations allow
    float primitive_tumbles = 0.25f;
    // Captions.
    // A colour or material is said of an object only if at least this share of what is seen of it shows it.
    float stated_share = 0.0f;
    float say_ground = 0.12f, say_part = 0.3f, synonym = 0.12f, bare = 0.08f, prefix = 0.35f;
    // Queries.
    float shape_for_shape = 0.0f;  // of the absent ones: a seen colour with a shape that is not there
    // View.
    float elevation_min = 0.0f, elevation_max = 75.0f, fov_min = 20.0f, fov_max = 55.0f;
    float frame_min = 0.55f, frame_max = 1.12f, cropped = 0.12f;
    float shadows = 0.7f, blurred = 0.3f, grainy = 0.35f;
    // Twins: relative weights of the seven changes.
    std::array<float, 7> change = {2.5f, 2.0f, 1.5f, 1.2f, 1.0f, 0.6f, 1.2f};
};

Settings settings_from_json(std::string_view text);  // "" gives the default
std::string to_json(const Settings& settings);

}  // namespace fieldgraft::generator
