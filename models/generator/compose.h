// Drawing scenes, and their counterfactual twins, as specs. A filter decides which (shape, material, colour)
// combinations may appear: training splits never show a held-out one, not even as clutter; the held-out split's main
// objects are nothing else.
#pragma once

#include <optional>

#include "models/generator/captions.h"
#include "models/generator/settings.h"
#include "models/generator/spec.h"

namespace fieldgraft::generator {

enum class Filter : uint8_t { kTrain, kHeldOut };

struct Pair {
    SceneSpec scene[2];
    CaptionPlan plan;
    Change change = Change::kColour;
};

Pair draw_pair(Rng rng, const Settings& settings, Filter filter);

}  // namespace fieldgraft::generator
