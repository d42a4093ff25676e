// What a picture shows, before any geometry: the description that captions, masks, twins and the held-out filter are
// made from. Two twins' specs differ in exactly one thing. Indices are those of vocabulary.h and shapes.h.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "models/generator/vec.h"

namespace fieldgraft::generator {

enum class Role : uint8_t { kMain, kCopy, kSecond, kAddition, kClutter };
enum class Relation : uint8_t { kNone, kNextTo };
enum class Change : uint8_t { kColour, kMaterial, kShape, kAddition, kRemoval, kGround, kPartPaint };
constexpr int kChanges = 7;

struct PartPaint {
    int part;
    int colour;
    bool said = false;  // the captions name it
};

struct ObjectSpec {
    Role role = Role::kMain;
    int shape = 0, material = 0, colour = -1;
    int colour2 = -1;   // stripes and dots
    int lightness = 0;  // −1 dark, 0, +1 light: said in the caption when it is said at all
    uint64_t seed = 0;  // proportions, shades, texture
    std::vector<PartPaint> paints;
    std::vector<int> absent;
    Vec3 position;
    float yaw = 0.0f, tilt = 0.0f, size = 1.0f;
};

enum class GroundKind : uint8_t { kNone, kPlate, kDisc, kPlane };
enum class GroundStuff : uint8_t { kColour, kWood, kMarble, kBrick, kGrass, kSnow, kChecker, kBeige };
constexpr int kGroundStuffs = 8;

struct GroundSpec {
    GroundKind kind = GroundKind::kNone;
    GroundStuff stuff = GroundStuff::kColour;
    int colour = -1;
    float size = 1.5f, aspect = 1.0f;
    bool studs = false, rim = false;
    uint64_t seed = 0;
};

enum class BackdropKind : uint8_t { kWhite, kColour, kGradient, kNoise };
struct BackdropSpec {
    BackdropKind kind = BackdropKind::kWhite;
    int colour = -1;  // of kColour
    uint64_t seed = 0;
};

struct SceneSpec {
    std::vector<ObjectSpec> objects;  // the main one first
    Relation relation = Relation::kNone;
    GroundSpec ground;
    BackdropSpec backdrop;
    uint64_t view_seed = 0;  // camera, lights, exposure, blur, grain
};

std::string to_json(const SceneSpec& spec);

}  // namespace fieldgraft::generator
