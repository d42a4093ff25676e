// A scene in words: lower case, "a photo of a rusty red truck with black wheels on a wooden floor". What is said and
// how (synonyms, "golden" or "made of gold", article, prefix) is fixed by a plan, so that twins' captions differ only
// in what differs between them.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "models/generator/rng.h"
#include "models/generator/settings.h"
#include "models/generator/spec.h"

namespace fieldgraft::generator {

struct CaptionPlan {
    bool colour = true, material = true, ground = false, backdrop = false;
    bool synonym = false, suffix = false, both_colours = false;
    int with_part = -1;  // a part that the first twin's caption affirms and the second's denies
    uint64_t seed = 0;
};

CaptionPlan draw_plan(Rng& rng, const Settings& settings);
std::string caption(const SceneSpec& scene, const CaptionPlan& plan, const Settings& settings);
// Shape, material and colour of the main object as far as the caption says them; −1 elsewhere. Plain paint has no
// word: it counts as said when a colour is.
std::array<int16_t, 3> said_attributes(const SceneSpec& scene, const CaptionPlan& plan);

// "a", "an" in front of a phrase; the phrase itself when it is empty.
std::string with_article(const std::string& phrase);
std::string noun(int shape, bool plural, bool synonym, Rng rng);
std::string ground_phrase(const GroundSpec& ground, Rng rng, bool bare);

}  // namespace fieldgraft::generator
