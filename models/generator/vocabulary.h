// The words of the generated pictures: colours, materials, parts, and how each is said.
// Colour and material indices are the ones of the "attributes" that a batch carries. A material `takes_colour` when
// a colour word may stand beside it (a red striped ball); gold, silver, wood, marble and brick bring their own.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "models/generator/rng.h"

namespace fieldgraft::generator {

enum Colour : int { kRed, kOrange, kYellow, kGreen, kBlue, kPurple, kPink, kBrown, kBlack, kWhite, kGrey, kColours };
enum Material : int {
    kPlain,
    kGold,
    kSilver,
    kGlass,
    kWood,
    kMarble,
    kBrick,
    kRusty,
    kMossy,
    kSnow,
    kBurning,
    kStriped,
    kDotted,
    kMaterials
};

// clang-format off
#define FIELDGRAFT_PARTS(X) \
    X(Body, "body") X(Legs, "legs") X(Seat, "seat") X(Back, "back") X(Arms, "arms") X(Handle, "handle") \
    X(Wheels, "wheels") X(Tracks, "tracks") X(Blade, "blade") X(Cab, "cab") X(Roof, "roof") X(Windows, "windows") \
    X(Door, "door") X(Chimney, "chimney") X(Sail, "sail") X(Hull, "hull") X(Mast, "mast") X(Trunk, "trunk") \
    X(Leaves, "leaves") X(Lampshade, "lampshade") X(Base, "base") X(Stand, "stand") X(Ears, "ears") X(Eyes, "eyes") \
    X(Nose, "nose") X(Mouth, "mouth") X(Brim, "brim") X(Band, "hat band") X(Jewels, "jewels") X(Cap, "cap") \
    X(Label, "label") X(Mattress, "mattress") X(Pillow, "pillow") X(Headboard, "headboard") X(Head, "head") \
    X(Antenna, "antenna") X(Stem, "stem") X(Spots, "spots") X(Scarf, "scarf") X(Buttons, "buttons") X(Fins, "fins") \
    X(Wings, "wings") X(Tail, "tail") X(Propeller, "propeller") X(Engine, "engine") X(Exhaust, "exhaust pipe") \
    X(Bumper, "bumper") X(Lights, "headlights") X(Cargo, "cargo bed") X(Mesh, "mesh") X(Top, "table top") \
    X(Points, "points") X(Flames, "flames") X(Pot, "pot") X(Blanket, "blanket") X(Face, "face") X(Frame, "frame") \
    X(Rungs, "crossbars") X(Muzzle, "muzzle") X(Lift, "lift arms") X(Petals, "petals") X(Fruit, "fruit") \
    X(Flag, "flag") X(Towers, "towers") X(Beak, "beak") X(Deck, "deck") X(Skins, "drumheads")
// clang-format on

enum Part : int {
#define FIELDGRAFT_PART(name, text) k##name,
    FIELDGRAFT_PARTS(FIELDGRAFT_PART)
#undef FIELDGRAFT_PART
        kParts
};

std::string_view colour_name(int colour);
std::string_view material_name(int material);  // "gold", "snow-covered", …; "plain" for 0
std::string_view part_name(int part);
// Another word for a part ("bucket" for the blade) some of the time, else its name.
std::string_view part_word(int part, Rng& rng);
bool part_is_plural(int part);
bool takes_colour(int material);

// A material as an adjective ("golden"), or as a phrase after the noun ("made of gold"); empty where there is none.
std::string material_adjective(int material, Rng& rng);
std::string material_suffix(int material, Rng& rng);

// A colour with the spread that its word covers, squared-root encoded like a pixel; `lightness` −1 dark, +1 light.
Vec3 sample_colour(int colour, int lightness, Rng& rng);

// Which combinations are kept for the held-out split: colour −1 where the material brings its own.
bool is_held_out(int shape, int material, int colour);

}  // namespace fieldgraft::generator
