#include "models/generator/vocabulary.h"

#include <array>

#include "models/generator/shapes.h"

namespace fieldgraft::generator {
namespace {

constexpr std::array<std::string_view, kColours> kColourNames = {"red",  "orange", "yellow", "green", "blue", "purple",
                                                                 "pink", "brown",  "black",  "white", "grey"};
constexpr std::array<std::string_view, kMaterials> kMaterialNames = {
    "plain", "gold",  "silver",       "glass",   "wood",    "marble",      "brick",
    "rusty", "mossy", "snow-covered", "burning", "striped", "polka-dotted"};
constexpr std::array<std::string_view, kParts> kPartNames = {
#define FIELDGRAFT_PART(name, text) text,
    FIELDGRAFT_PARTS(FIELDGRAFT_PART)
#undef FIELDGRAFT_PART
};

struct Words {
    std::vector<const char*> adjectives, suffixes;
};
const std::array<Words, kMaterials>& material_words() {
    static const std::array<Words, kMaterials> words = {{
        {{"plastic"}, {"made of plastic"}},
        {{"golden", "gold", "shiny golden"}, {"made of gold", "made out of gold", "made of shiny gold"}},
        {{"silver", "shiny silver", "chrome"}, {"made of silver", "made of chrome", "made of shiny metal"}},
        {{"glass", "transparent"}, {"made of glass"}},
        {{"wooden", "wood"}, {"made of wood", "made out of wood", "carved from wood"}},
        {{"marble"}, {"made of marble", "carved from marble"}},
        {{"brick"}, {"made of bricks", "made of brick", "built from bricks"}},
        {{"rusty", "rusted", "old rusty"}, {"covered in rust", "with rust on it"}},
        {{"mossy", "moss-covered", "overgrown"}, {"covered in moss", "overgrown with moss", "with moss on it"}},
        {{"snow-covered", "snowy"}, {"covered in snow", "with snow on it", "with snow on top", "under snow"}},
        {{"burning", "flaming"}, {"on fire", "in flames", "that is burning", "with fire on it"}},
        {{"striped", "stripy"}, {"with stripes", "with a striped pattern"}},
        {{"polka-dotted", "spotted", "dotted"}, {"with polka dots", "with dots", "with a polka dot pattern"}},
    }};
    return words;
}

// Hue in degrees, saturation and value (of the encoded pixel), as ranges.
struct HsvRange {
    float h0, h1, s0, s1, v0, v1;
};
constexpr std::array<HsvRange, kColours> kRanges = {{
    {-7, 7, .78f, 1, .60f, .95f},
    {15, 31, .82f, 1, .85f, 1},
    {41, 57, .72f, 1, .80f, 1},
    {92, 148, .50f, 1, .38f, .85f},
    {206, 236, .62f, 1, .50f, .95f},
    {270, 294, .48f, .9f, .42f, .80f},
    {318, 348, .32f, .62f, .88f, 1},
    {17, 31, .50f, .80f, .30f, .48f},
    {0, 360, .0f, .20f, .05f, .16f},
    {0, 360, .0f, .05f, .90f, .98f},
    {0, 360, .0f, .07f, .38f, .64f},
}};

Vec3 hsv(float h, float s, float v) {
    const auto channel = [&](float n) {
        float k = n + h / 60.0f;
        k -= 6.0f * std::floor(k / 6.0f);
        return v - v * s * clamp01(std::min(k, 4.0f - k));
    };
    return {channel(5), channel(3), channel(1)};
}

constexpr uint64_t kHeldOutSeed = 16;

uint64_t combination(std::string_view kind, int a, int b, int c) {
    std::string key(kind);
    key += '|';
    if (a >= 0) key += shape_info(a).name;
    key += '|';
    if (b >= 0) key += material_name(b);
    key += '|';
    if (c >= 0) key += colour_name(c);
    return hash_text(key, kHeldOutSeed);
}

}  // namespace

std::string_view colour_name(int colour) {
    return kColourNames.at(static_cast<size_t>(colour));
}
std::string_view material_name(int material) {
    return kMaterialNames.at(static_cast<size_t>(material));
}
std::string_view part_name(int part) {
    return kPartNames.at(static_cast<size_t>(part));
}

std::string_view part_word(int part, Rng& rng) {
    const bool other = rng.chance(0.25f);
    const int pick = rng.below(2);
    if (!other) return part_name(part);
    switch (part) {
        case kBlade:
            return pick ? "bucket" : "shovel";
        case kCab:
            return "cabin";
        case kTracks:
            return "treads";
        case kMuzzle:
            return "snout";
        case kLights:
            return "lights";
        case kBack:
            return "backrest";
        default:
            return part_name(part);
    }
}

bool part_is_plural(int part) {
    const std::string_view name = part_name(part);
    return name.ends_with('s') || part == kFruit;
}

bool takes_colour(int material) {
    switch (material) {
        case kPlain:
        case kGlass:
        case kRusty:
        case kMossy:
        case kSnow:
        case kBurning:
        case kStriped:
        case kDotted:
            return true;
        default:
            return false;
    }
}

std::string material_adjective(int material, Rng& rng) {
    const auto& list = material_words().at(static_cast<size_t>(material)).adjectives;
    // The first form is the usual one.
    const bool usual = rng.chance(0.55f);
    const int pick = rng.below(static_cast<int>(list.size()));
    return list[usual ? 0 : static_cast<size_t>(pick)];
}

std::string material_suffix(int material, Rng& rng) {
    const auto& list = material_words().at(static_cast<size_t>(material)).suffixes;
    const bool usual = rng.chance(0.5f);
    const int pick = rng.below(static_cast<int>(list.size()));
    return list[usual ? 0 : static_cast<size_t>(pick)];
}

Vec3 sample_colour(int colour, int lightness, Rng& rng) {
    const HsvRange& r = kRanges.at(static_cast<size_t>(colour));
    const float h = rng.uniform(r.h0, r.h1);
    float s = rng.uniform(r.s0, r.s1), v = rng.uniform(r.v0, r.v1);
    if (lightness > 0) {
        s *= 0.62f;
        v = std::min(1.0f, v * 1.25f + 0.1f);
    } else if (lightness < 0) {
        v *= 0.62f;
    }
    return hsv(h, s, v);
}

bool is_held_out(int shape, int material, int colour) {
    // About one pair in twelve and one triple in twelve more. The seed was chosen so that the combinations
    // which the documentation uses as examples (yellow, red, blue, golden, wooden bulldozers) are trained on.
    if (combination("shape-material", shape, material, -1) % 12 == 0 && material != kPlain) return true;
    if (colour < 0) return false;
    if (combination("shape-colour", shape, -1, colour) % 12 == 0) return true;
    return combination("triple", shape, material, colour) % 12 == 0;
}

}  // namespace fieldgraft::generator
