// Chair, table, stool, bed, lamp, house.
#include "models/generator/shapes.h"

namespace fieldgraft::generator {
namespace {

void four_legs(Builder& b, float x, float y, float height, float r) {
    const bool round = b.rng.chance(0.4f);
    const float splay = b.rng.chance(0.3f) ? b.rng.uniform(0.0f, 0.15f) : 0.0f;
    for (const float sx : {-1.0f, 1.0f}) {
        for (const float sy : {-1.0f, 1.0f}) {
            if (round || splay > 0.0f) {
                b.rod(kLegs, {sx * (x + splay), sy * (y + splay), 0}, {sx * x, sy * y, height}, r * 0.8f, r);
            } else {
                b.box(kLegs, {sx * x, sy * y, 0.5f * height}, {r, r, 0.5f * height});
            }
        }
    }
}

void build_chair(Builder& b) {
    const float w = b.rng.uniform(0.42f, 0.55f), d = b.rng.uniform(0.42f, 0.55f), h = b.rng.uniform(0.65f, 1.0f);
    const float thick = b.rng.uniform(0.05f, 0.12f), leg = b.rng.uniform(0.045f, 0.09f);
    const float top = b.rng.uniform(0.7f, 1.15f), lean = b.rng.uniform(0.0f, 0.16f);
    four_legs(b, d - leg, w - leg, h, leg);
    b.box(kSeat, {0, 0, h + thick}, {d, w, thick});
    const Mat3 tilt = rotation_y(-lean);
    const Vec3 foot{-d + leg, 0, h + 2 * thick};
    const auto back = [&](float y, float z, float hy, float hz) {
        b.box(kBack, foot + tilt * Vec3{0, y, z}, {leg * 0.8f, hy, hz}, tilt);
    };
    const int style = b.rng.below(3);
    if (style == 0) {
        back(0, 0.5f * top, w, 0.5f * top);
    } else {
        back(-w + leg, 0.5f * top, leg, 0.5f * top);
        back(w - leg, 0.5f * top, leg, 0.5f * top);
        if (style == 1) {
            for (int i = 0; i < 3; ++i) back(0, top * (0.35f + 0.28f * static_cast<float>(i)), w - leg, top * 0.09f);
        } else {
            back(0, top * 0.93f, w - leg, top * 0.09f);
            for (int i = 0; i < 4; ++i)
                back(w * (-0.54f + 0.36f * static_cast<float>(i)), top * 0.45f, w * 0.08f, top * 0.45f);
        }
    }
    if (b.rng.chance(0.25f)) {
        for (const float s : {-1.0f, 1.0f}) {
            b.box(kArms, {0, s * (w - 0.04f), h + 0.42f}, {d, 0.05f, 0.04f});
            b.box(kArms, {d - 0.06f, s * (w - 0.04f), h + 0.2f}, {0.05f, 0.05f, 0.22f});
        }
    }
    b.anchor({0, 0, h + 2 * thick}, w);
}

void build_table(Builder& b) {
    const float w = b.rng.uniform(0.6f, 1.0f), thick = b.rng.uniform(0.05f, 0.1f), h = b.rng.uniform(0.65f, 1.0f);
    const float leg = b.rng.uniform(0.05f, 0.1f);
    if (b.rng.chance(0.3f)) {
        b.rod(kTop, {0, 0, h}, {0, 0, h + 2 * thick}, 0.95f);
        if (b.rng.chance(0.5f)) {
            b.rod(kLegs, {0, 0, 0}, {0, 0, h}, leg * 1.4f);
            b.rod(kLegs, {0, 0, 0}, {0, 0, 0.08f}, 0.5f, 0.3f);
        } else {
            four_legs(b, 0.55f, 0.55f, h, leg);
        }
    } else {
        b.box(kTop, {0, 0, h + thick}, {1, w, thick});
        four_legs(b, 1 - leg * 1.5f, w - leg * 1.5f, h, leg);
        if (b.rng.chance(0.4f)) b.box(kBody, {0, 0, h - 0.08f}, {0.9f, w - 0.12f, 0.08f});
    }
    b.anchor({0, 0, h + 2 * thick}, w);
}

void build_stool(Builder& b) {
    const float h = b.rng.uniform(1.0f, 1.7f), r = b.rng.uniform(0.45f, 0.62f), leg = b.rng.uniform(0.05f, 0.08f);
    b.rod(kSeat, {0, 0, h}, {0, 0, h + b.rng.uniform(0.12f, 0.25f)}, r);
    const int legs = b.rng.between(3, 4);
    const float turn = b.rng.uniform(0, 6.28f);
    for (int i = 0; i < legs; ++i) {
        const float a = turn + 2 * kPi * static_cast<float>(i) / static_cast<float>(legs);
        b.rod(kLegs, {r * cosine(a) * 1.1f, r * sine(a) * 1.1f, 0}, {r * cosine(a) * 0.65f, r * sine(a) * 0.65f, h},
              leg);
    }
    if (b.rng.chance(0.6f)) b.ring(kRungs, {0, 0, h * 0.4f}, {0, 0, 1}, r * 0.93f, leg * 0.7f);
}

void build_bed(Builder& b) {
    const float w = b.rng.uniform(0.5f, 0.75f), h = b.rng.uniform(0.2f, 0.35f);
    b.box(kFrame, {0, 0, h}, {1.1f, w, 0.08f});
    for (const float sx : {-1.0f, 1.0f}) {
        for (const float sy : {-1.0f, 1.0f})
            b.box(kLegs, {sx * 1.02f, sy * (w - 0.07f), h * 0.5f}, {0.07f, 0.07f, h * 0.5f});
    }
    b.box(kMattress, {0.02f, 0, h + 0.19f}, {1.04f, w - 0.03f, 0.12f});
    b.box(kBlanket, {0.33f, 0, h + 0.21f}, {0.76f, w + 0.01f, 0.13f});
    b.ball(kPillow, {-0.76f, -w * 0.42f, h + 0.36f}, {0.2f, w * 0.36f, 0.1f});
    b.ball(kPillow, {-0.76f, w * 0.42f, h + 0.36f}, {0.2f, w * 0.36f, 0.1f});
    const float board = b.rng.uniform(0.35f, 0.6f);
    b.box(kHeadboard, {-1.12f, 0, h + board * 0.6f}, {0.06f, w + 0.02f, board * 0.9f});
    if (b.rng.chance(0.5f)) b.box(kFrame, {1.12f, 0, h + 0.16f}, {0.05f, w, 0.22f});
    b.anchor({0.2f, 0, h + 0.34f}, w);
}

void build_lamp(Builder& b) {
    const float h = b.rng.uniform(0.9f, 1.8f), r = b.rng.uniform(0.42f, 0.62f), shade = b.rng.uniform(0.45f, 0.75f);
    b.rod(kBase, {0, 0, 0}, {0, 0, 0.1f}, r * 0.75f, r * 0.6f);
    if (b.rng.chance(0.35f)) {
        b.ball(kStand, {0, 0, 0.1f + h * 0.35f}, {r * 0.55f, r * 0.55f, h * 0.35f});
    }
    b.rod(kStand, {0, 0, 0.1f}, {0, 0, h + 0.15f}, b.rng.uniform(0.05f, 0.09f));
    b.rod(kLampshade, {0, 0, h}, {0, 0, h + shade}, r, r * b.rng.uniform(0.4f, 0.8f));
}

void build_house(Builder& b) {
    const float l = b.rng.uniform(0.8f, 1.1f), w = b.rng.uniform(0.65f, 0.85f), h = b.rng.uniform(0.45f, 0.75f);
    const float roof = b.rng.uniform(0.35f, 0.6f), over = b.rng.uniform(0.08f, 0.16f);
    b.box(kBody, {0, 0, h}, {l, w, h});
    const bool hipped = b.rng.chance(0.25f);
    if (hipped) {
        b.pyramid(kRoof, {0, 0, 2 * h + roof}, {l * 1.0f + over, w + over, roof});
    } else {
        b.gable(kRoof, {0, 0, 2 * h + roof}, {w + over, l + over, roof}, rotation_z(0.5f * kPi));
    }
    b.box(kDoor, {l, w * b.rng.uniform(-0.2f, 0.2f), h * 0.55f}, {0.02f, 0.15f, h * 0.55f});
    for (const float sy : {-1.0f, 1.0f}) {
        for (const float x : {-0.5f, 0.5f}) b.box(kWindows, {x * l, sy * w, h * 1.1f}, {0.16f, 0.025f, 0.18f});
        b.box(kWindows, {l, sy * w * 0.62f, h * 1.2f}, {0.025f, 0.13f, 0.16f});
        b.box(kWindows, {-l, sy * w * 0.5f, h * 1.1f}, {0.025f, 0.15f, 0.16f});
    }
    if (b.rng.chance(0.65f)) {
        b.box(kChimney, {-l * 0.5f, w * 0.4f, 2 * h + roof * 1.3f}, {0.11f, 0.11f, roof * 0.75f});
    }
    b.anchor({0, 0, 2 * h + 2 * roof * 0.9f}, w * 0.7f);
}

}  // namespace

std::vector<ShapeInfo> furniture_shapes() {
    const uint32_t cloth = bit(kWhite) | bit(kRed) | bit(kBlue) | bit(kPink) | bit(kGreen) | bit(kYellow);
    return {
        {"chair",
         "chairs",
         {},
         {{kBack, .12f, 0, true}, {kSeat, .3f, 0, false}, {kLegs, .3f, 0, true}, {kArms, .1f, 0, true}},
         build_chair},
        {"table", "tables", {"desk"}, {{kTop, .2f, 0, false}, {kLegs, .35f, 0, true}}, build_table},
        {"stool", "stools", {}, {{kSeat, .4f, 0, false}, {kLegs, .1f, 0, true}, {kRungs, .1f, 0, true}}, build_stool},
        {"bed",
         "beds",
         {},
         {{kMattress, .7f, bit(kWhite) | bit(kGrey), false},
          {kPillow, .75f, cloth, true},
          {kBlanket, .1f, 0, true},
          {kHeadboard, .5f, bit(kBrown) | bit(kBlack) | bit(kWhite), true},
          {kFrame, .6f, bit(kBrown) | bit(kBlack) | bit(kWhite), false},
          {kLegs, .6f, bit(kBrown) | bit(kBlack), true}},
         build_bed},
        {"lamp",
         "lamps",
         {},
         {{kLampshade, .15f, 0, true},
          {kStand, .5f, bit(kBlack) | bit(kGrey) | bit(kBrown), false},
          {kBase, .5f, bit(kBlack) | bit(kGrey) | bit(kBrown), true}},
         build_lamp,
         false,
         true},
        {"house",
         "houses",
         {"cabin"},
         {{kRoof, .75f, bit(kRed) | bit(kBrown) | bit(kBlack) | bit(kGrey) | bit(kOrange), true},
          {kWindows, .85f, bit(kBlue) | bit(kBlack) | bit(kWhite) | bit(kYellow), true},
          {kDoor, .85f, bit(kBrown) | bit(kRed) | bit(kBlack) | bit(kGreen), true},
          {kChimney, .6f, bit(kRed) | bit(kGrey) | bit(kBrown), true}},
         build_house},
    };
}

}  // namespace fieldgraft::generator
