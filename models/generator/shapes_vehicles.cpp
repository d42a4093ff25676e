// Truck, car, boat, plane, rocket, train. The front is +x.
#include "models/generator/shapes.h"

namespace fieldgraft::generator {
namespace {

void build_truck(Builder& b) {
    const float w = b.rng.uniform(0.4f, 0.52f), r = b.rng.uniform(0.17f, 0.24f), cab = b.rng.uniform(0.36f, 0.48f);
    const float deck = r * 1.3f, front = 0.72f;
    b.box(kBody, {-0.05f, 0, deck + 0.06f}, {1.05f, w * 0.8f, 0.07f})->shade = 0.6f;
    b.box(kCab, {front, 0, deck + 0.1f + cab}, {0.3f, w, cab});
    b.box(kWindows, {front + 0.3f, 0, deck + 0.1f + cab * 1.4f}, {0.02f, w * 0.85f, cab * 0.36f});
    for (const float s : {-1.0f, 1.0f}) {
        b.box(kWindows, {front + 0.05f, s * w, deck + 0.1f + cab * 1.4f}, {0.18f, 0.02f, cab * 0.33f});
        b.ball(kLights, {front + 0.3f, s * w * 0.7f, deck + 0.22f}, 0.07f);
    }
    b.box(kBumper, {front + 0.33f, 0, deck + 0.06f}, {0.06f, w, 0.07f});
    const float bed = b.rng.uniform(0.2f, 0.65f), high = deck + 0.14f;
    if (b.rng.chance(0.5f)) {  // closed box
        b.box(kCargo, {-0.38f, 0, high + cab * 1.1f}, {0.72f, w * 1.05f, cab * 1.1f});
        if (b.rng.chance(0.4f)) b.pattern(0.18f);
    } else {  // open bed
        b.box(kCargo, {-0.38f, 0, high + 0.05f}, {0.72f, w, 0.06f});
        for (const float s : {-1.0f, 1.0f})
            b.box(kCargo, {-0.38f, s * w, high + bed * 0.5f}, {0.72f, 0.04f, bed * 0.5f});
        b.box(kCargo, {-1.08f, 0, high + bed * 0.5f}, {0.04f, w, bed * 0.5f});
        b.box(kCargo, {0.33f, 0, high + bed * 0.6f}, {0.04f, w, bed * 0.6f});
    }
    const int axles = b.rng.between(2, 3);
    for (const float s : {-1.0f, 1.0f}) {
        b.wheel(kWheels, {front, s * w * 0.92f, r}, r, 0.1f);
        b.wheel(kWheels, {-0.75f, s * w * 0.92f, r}, r, 0.1f);
        if (axles == 3) b.wheel(kWheels, {-0.25f, s * w * 0.92f, r}, r, 0.1f);
    }
    b.anchor({front, 0, deck + 0.1f + 2 * cab}, w);
}

void build_car(Builder& b) {
    const float w = b.rng.uniform(0.42f, 0.5f), r = b.rng.uniform(0.17f, 0.23f), h = b.rng.uniform(0.14f, 0.2f);
    const float cabin = b.rng.uniform(0.17f, 0.26f), x = b.rng.uniform(-0.22f, -0.02f), floor = r * 0.8f;
    b.box(kBody, {0, 0, floor + h}, {0.98f, w, h});
    b.rod(kBody, {0.95f, -w, floor + h}, {0.95f, w, floor + h}, h);
    b.rod(kBody, {-0.95f, -w, floor + h}, {-0.95f, w, floor + h}, h);
    const float low = floor + 2 * h;
    b.box(kWindows, {x, 0, low + cabin * 0.9f}, {0.4f, w * 0.86f, cabin * 0.9f});
    b.wedge(kWindows, {x + 0.55f, 0, low + cabin * 0.8f}, {0.17f, w * 0.8f, cabin * 0.8f});
    b.wedge(kWindows, {x - 0.52f, 0, low + cabin * 0.8f}, {0.14f, w * 0.8f, cabin * 0.8f}, rotation_z(kPi));
    b.box(kRoof, {x, 0, low + cabin * 1.85f}, {0.42f, w * 0.9f, 0.045f});
    for (const float s : {-1.0f, 1.0f}) {
        for (const float px : {-0.4f, 0.02f, 0.4f})
            b.box(kBody, {x + px, s * w * 0.87f, low + cabin * 0.9f}, {0.035f, 0.02f, cabin * 0.9f});
        b.ball(kLights, {1.08f, s * w * 0.65f, floor + h * 1.2f}, 0.075f);
        b.wheel(kWheels, {0.6f, s * w, r}, r, 0.09f);
        b.wheel(kWheels, {-0.6f, s * w, r}, r, 0.09f);
    }
    b.box(kBumper, {1.1f, 0, floor + 0.05f}, {0.05f, w * 0.9f, 0.05f});
    b.box(kBumper, {-1.1f, 0, floor + 0.05f}, {0.05f, w * 0.9f, 0.05f});
    b.anchor({x, 0, low + cabin * 1.85f + 0.045f}, w);
}

void build_boat(Builder& b) {
    const float w = b.rng.uniform(0.32f, 0.45f), h = b.rng.uniform(0.16f, 0.25f);
    b.box(kHull, {-0.2f, 0, h}, {0.72f, w, h});
    b.wedge(kHull, {0.82f, 0, h * 0.0f + h}, {0.3f, w * 0.75f, h}, rotation_y(kPi) * rotation_z(kPi));
    b.gable(kHull, {0.86f, 0, h * 1.45f}, {w, h * 0.55f, 0.34f}, Mat3{{0, 1, 0}, {0, 0, 1}, {1, 0, 0}});
    b.box(kDeck, {-0.15f, 0, 2 * h}, {0.7f, w * 0.82f, 0.025f})->shade = 0.7f;
    const int style = b.rng.below(3);
    const float mast = b.rng.uniform(1.2f, 1.7f);
    if (style != 1) {  // sailing boat
        b.rod(kMast, {0.1f, 0, 2 * h}, {0.1f, 0, 2 * h + mast}, 0.04f);
        if (style == 0) {
            const Mat3 flat{{-1, 0, 0}, {0, -1, 0}, {0, 0, 1}};
            b.wedge(kSail, {-0.34f, 0, 2 * h + 0.12f + mast * 0.42f}, {0.4f, 0.02f, mast * 0.42f}, flat);
            b.wedge(kSail, {0.4f, 0, 2 * h + 0.1f + mast * 0.36f}, {0.26f, 0.02f, mast * 0.36f});
        } else {
            b.box(kSail, {0.16f, 0, 2 * h + mast * 0.55f}, {0.02f, w * 1.5f, mast * 0.34f});
        }
    } else {
        b.box(kCab, {-0.35f, 0, 2 * h + 0.22f}, {0.32f, w * 0.65f, 0.22f});
        for (const float s : {-1.0f, 1.0f}) {
            for (const float px : {-0.15f, 0.15f})
                b.box(kWindows, {-0.35f + px, s * w * 0.65f, 2 * h + 0.25f}, {0.08f, 0.02f, 0.08f});
        }
        b.rod(kChimney, {-0.4f, 0, 2 * h + 0.4f}, {-0.4f, 0, 2 * h + 0.85f}, 0.13f);
    }
    b.anchor({-0.6f, 0, 2 * h + 0.03f}, w);
}

void build_plane(Builder& b) {
    const float r = b.rng.uniform(0.15f, 0.2f), span = b.rng.uniform(0.9f, 1.15f), chord = b.rng.uniform(0.17f, 0.25f);
    const float z = 0.45f, sweep = b.rng.uniform(0.0f, 0.45f);
    b.rod(kBody, {-0.65f, 0, z}, {0.6f, 0, z}, r);
    b.ball(kBody, {0.6f, 0, z}, {0.35f, r, r});
    b.rod(kBody, {-0.65f, 0, z}, {-1.1f, 0, z + r * 0.4f}, r, r * 0.3f);
    for (const float s : {-1.0f, 1.0f}) {
        b.box(kWings, {0.12f - sweep * span * 0.4f, s * span * 0.5f, z - 0.04f}, {chord, span * 0.54f, 0.03f},
              rotation_z(s * sweep));
        b.box(kTail, {-1.0f, s * 0.22f, z + 0.08f}, {0.11f, 0.24f, 0.025f});
        if (sweep > 0.2f)
            b.rod(kEngine, {0.0f, s * span * 0.42f, z - 0.13f}, {0.3f, s * span * 0.42f, z - 0.13f}, 0.085f);
    }
    b.box(kTail, {-1.02f, 0, z + 0.28f}, {0.12f, 0.025f, 0.24f}, rotation_y(0.3f));
    b.ball(kWindows, {0.52f, 0, z + r * 0.65f}, {0.2f, r * 0.65f, r * 0.6f});
    if (sweep <= 0.2f) {
        b.box(kPropeller, {0.97f, 0, z}, {0.015f, 0.035f, 0.36f}, rotation_x(b.rng.uniform(0, 3.1f)));
        b.ball(kPropeller, {0.97f, 0, z}, 0.06f);
    }
    if (b.rng.chance(0.5f)) {
        for (const Vec3 at : {Vec3{0.5f, 0, 0.12f}, Vec3{-0.05f, 0.25f, 0.12f}, Vec3{-0.05f, -0.25f, 0.12f}}) {
            b.wheel(kWheels, at, 0.1f, 0.04f);
            b.rod(kBody, at, at + Vec3{0, 0, 0.25f}, 0.025f);
        }
    }
    b.anchor({0.1f, 0, z + r}, r);
}

void build_rocket(Builder& b) {
    const float r = b.rng.uniform(0.26f, 0.4f), h = b.rng.uniform(1.1f, 1.6f), nose = b.rng.uniform(0.5f, 0.8f);
    b.rod(kBody, {0, 0, 0.3f}, {0, 0, 0.3f + h}, r);
    b.rod(kNose, {0, 0, 0.3f + h}, {0, 0, 0.3f + h + nose}, r, 0.01f);
    const int fins = b.rng.between(3, 4);
    const float turn = b.rng.uniform(0, 6.28f), reach = b.rng.uniform(0.3f, 0.42f);
    for (int i = 0; i < fins; ++i) {
        const float a = turn + 2 * kPi * static_cast<float>(i) / static_cast<float>(fins);
        const Mat3 m = rotation_z(a);
        b.wedge(kFins, m * Vec3{r + reach * 0.5f, 0, 0.45f}, {reach * 0.6f, 0.045f, 0.42f}, m);
    }
    const int windows = b.rng.between(1, 2);
    for (int i = 0; i < windows; ++i) {
        for (const float s : {0.0f, 0.5f}) {
            const Mat3 m = rotation_z(turn + 0.6f + 2 * kPi * s);
            const Vec3 at = m * Vec3{r, 0, 0.3f + h * (0.75f - 0.3f * static_cast<float>(i))};
            b.ball(kWindows, at, {0.06f, 0.14f, 0.14f}, m);
        }
    }
    b.rod(kEngine, {0, 0, 0.3f}, {0, 0, 0.08f}, r * 0.6f, r * 0.8f);
}

void build_train(Builder& b) {
    const float w = 0.36f, r = b.rng.uniform(0.15f, 0.19f), boiler = b.rng.uniform(0.25f, 0.32f);
    b.box(kBody, {0, 0, r * 1.6f}, {1.0f, w, 0.08f});
    b.rod(kEngine, {-0.3f, 0, r * 1.6f + 0.08f + boiler}, {0.9f, 0, r * 1.6f + 0.08f + boiler}, boiler);
    const float h = b.rng.uniform(0.4f, 0.48f), z = r * 1.6f + 0.08f;
    b.box(kCab, {-0.65f, 0, z + h}, {0.3f, w, h});
    b.box(kRoof, {-0.65f, 0, z + 2 * h + 0.04f}, {0.38f, w * 1.15f, 0.05f});
    for (const float s : {-1.0f, 1.0f}) b.box(kWindows, {-0.62f, s * w, z + h * 1.4f}, {0.16f, 0.02f, h * 0.35f});
    const float chimney = b.rng.uniform(0.25f, 0.4f);
    b.rod(kChimney, {0.65f, 0, z + boiler * 1.9f}, {0.65f, 0, z + boiler * 1.9f + chimney}, 0.08f, 0.14f);
    b.dome(kBody, {0.15f, 0, z + boiler * 1.9f}, {0.13f, 0.13f, 0.14f});
    b.wedge(kBumper, {1.1f, 0, r * 0.9f}, {0.14f, w * 0.95f, r * 0.8f});
    for (const float s : {-1.0f, 1.0f}) {
        for (const float x : {-0.7f, -0.15f, 0.25f, 0.65f})
            b.wheel(kWheels, {x, s * w * 0.95f, r}, x < -0.5f ? r * 1.2f : r, 0.06f);
    }
    b.anchor({-0.65f, 0, z + 2 * h + 0.09f}, w);
}

}  // namespace

std::vector<ShapeInfo> vehicle_shapes() {
    const uint32_t dark = bit(kBlack) | bit(kGrey);
    const uint32_t pane = bit(kBlack) | bit(kBlue) | bit(kWhite) | bit(kGrey);
    const PartRule wheels{kWheels, .85f, dark, true}, windows{kWindows, .9f, pane, true};
    return {
        {"bulldozer",
         "bulldozers",
         {"digger"},
         {{kTracks, .85f, dark, true},
          {kBlade, .5f, dark | bit(kYellow) | bit(kRed), true},
          {kCab, .12f, 0, false},
          {kRoof, .2f, 0, false},
          windows,
          {kSeat, .8f, dark | bit(kRed), false},
          {kEngine, .5f, dark, false},
          {kLift, .45f, dark, false},
          {kExhaust, .7f, dark, false},
          {kLights, .8f, bit(kWhite) | bit(kYellow) | bit(kRed), false}},
         build_bulldozer,
         false,
         true,
         bit(kYellow) | bit(kOrange),
         2.0f},
        {"truck",
         "trucks",
         {"lorry"},
         {wheels,
          {kCargo, .45f, 0, true},
          {kCab, .08f, 0, false},
          windows,
          {kBumper, .6f, dark, false},
          {kLights, .8f, bit(kWhite) | bit(kYellow), false}},
         build_truck,
         false,
         true,
         bit(kRed) | bit(kYellow) | bit(kBlue)},
        {"car",
         "cars",
         {},
         {wheels,
          {kRoof, .12f, 0, true},
          {kWindows, .95f, bit(kBlack) | bit(kBlue), false},
          {kBumper, .6f, dark, false},
          {kLights, .9f, bit(kWhite) | bit(kYellow), false}},
         build_car},
        {"boat",
         "boats",
         {"ship"},
         {{kSail, .8f, bit(kWhite) | bit(kRed) | bit(kYellow), true},
          {kHull, .05f, 0, false},
          {kMast, .7f, bit(kBrown) | bit(kBlack) | bit(kWhite), true},
          {kCab, .7f, bit(kWhite) | bit(kRed), true},
          {kChimney, .7f, bit(kBlack) | bit(kRed) | bit(kYellow), false},
          {kDeck, .5f, bit(kBrown), false},
          windows},
         build_boat},
        {"plane",
         "planes",
         {"airplane", "aeroplane"},
         {{kWings, .2f, 0, true},
          {kTail, .3f, 0, true},
          {kPropeller, .8f, dark | bit(kBrown), true},
          {kEngine, .5f, dark, true},
          {kWindows, .9f, bit(kBlack) | bit(kBlue), false},
          {kWheels, .9f, bit(kBlack), true}},
         build_plane,
         false,
         false},
        {"rocket",
         "rockets",
         {"spaceship"},
         {{kFins, .65f, bit(kRed) | bit(kBlue) | bit(kBlack) | bit(kOrange), true},
          {kNose, .6f, bit(kRed) | bit(kBlue) | bit(kBlack) | bit(kOrange), false},
          {kWindows, .9f, bit(kBlue) | bit(kBlack), true},
          {kEngine, .8f, dark, false}},
         build_rocket,
         false,
         false,
         bit(kWhite) | bit(kRed) | bit(kGrey)},
        {"train",
         "trains",
         {"locomotive"},
         {wheels,
          {kCab, .3f, 0, false},
          {kEngine, .25f, bit(kBlack) | bit(kGreen) | bit(kRed), false},
          {kChimney, .6f, dark | bit(kRed), true},
          {kRoof, .5f, dark | bit(kRed), false},
          {kWindows, .7f, pane, true},
          {kBumper, .6f, dark | bit(kRed), false}},
         build_train},
    };
}

}  // namespace fieldgraft::generator
