// From a world and a view to a picture and what is seen in it. Visibility is exact ray casting at 2x2 samples a
// pixel; shading is done once a pixel and primitive. Shadows come from a small depth map along the key light; metals
// reflect a procedural surrounding; glass shows what is behind it, displaced; flames are soft and emit light.
#pragma once

#include <cstdint>
#include <vector>

#include "models/generator/world.h"

namespace fieldgraft::generator {

struct Frame {
    int size = 0;
    std::vector<uint8_t> pixels;   // size x size x 3
    std::vector<int16_t> visible;  // (2 size) x (2 size): index of the primitive seen, −1 backdrop
    std::vector<uint8_t> snow;     // size x size: 1 where snow is seen
};

Frame render(const World& world, const View& view, const BackdropSpec& backdrop, int size);

}  // namespace fieldgraft::generator
