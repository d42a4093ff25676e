// Pieces of scene drawing that compose.cpp and twins.cpp share.
#pragma once

#include <cstdint>

#include "models/generator/compose.h"
#include "models/generator/rng.h"
#include "models/generator/settings.h"
#include "models/generator/spec.h"

namespace fieldgraft::generator {

bool allowed(const ObjectSpec& object, Filter filter, bool main);
int draw_shape(Rng& rng);
// One of the colours in a bit mask; any when the mask is 0.
int colour_out_of(uint32_t mask, Rng& rng);
void draw_paints(ObjectSpec& object, const Settings& settings, Rng rng);
ObjectSpec draw_addition(const ObjectSpec& host, const Settings& settings, Filter filter, Rng rng);
void draw_surroundings(SceneSpec& scene, const Settings& settings, Rng rng);
// Makes pair.scene[1] out of pair.scene[0] by pair.change, and sets what the captions then have to say; false if the
// scene does not lend itself to it.
bool draw_twin(Pair& pair, const Settings& settings, Filter filter, Rng rng);

}  // namespace fieldgraft::generator
