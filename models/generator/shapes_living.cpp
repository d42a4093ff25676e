// Monkey head, robot, snowman, tree, mushroom, flower, duck, cat. The front is +x.
#include "models/generator/shapes.h"

namespace fieldgraft::generator {
namespace {

// Suzanne-like: wide brow with deep eyes, big flat ears, a long muzzle.
void build_monkey(Builder& b) {
    const float brow = b.rng.uniform(0.92f, 1.05f);
    b.ball(kHead, {-0.1f, 0, 0.95f}, {0.75f, 0.72f * brow, 0.72f});
    b.ball(kHead, {0.32f, 0.27f, 1.05f}, {0.3f, 0.33f, 0.3f})->shade = 1.05f;
    b.ball(kHead, {0.32f, -0.27f, 1.05f}, {0.3f, 0.33f, 0.3f})->shade = 1.05f;
    b.ball(kMuzzle, {0.48f, 0, 0.52f}, {0.38f, 0.4f, 0.34f});
    b.ball(kMuzzle, {0.6f, 0, 0.78f}, {0.2f, 0.16f, 0.14f})->shade = 0.85f;
    b.ball(kMouth, {0.74f, 0, 0.4f}, {0.13f, 0.24f, 0.045f})->shade = 0.5f;
    const float ear = b.rng.uniform(0.3f, 0.42f), out = b.rng.uniform(0.85f, 1.0f);
    for (const float s : {-1.0f, 1.0f}) {
        const Mat3 turn = rotation_z(s * 0.35f);
        b.ball(kEars, {-0.1f, s * out, 1.02f}, {0.12f, ear, ear * 1.05f}, turn);
        b.ball(kEars, {0.0f, s * out, 1.0f}, {0.08f, ear * 0.6f, ear * 0.65f}, turn)->shade = 0.55f;
        b.ball(kEyes, {0.54f, s * 0.25f, 1.04f}, {0.12f, 0.16f, 0.15f});
        b.ball(kEyes, {0.645f, s * 0.24f, 1.04f}, {0.05f, 0.07f, 0.07f})->shade = 0.05f;
    }
    b.anchor({-0.1f, 0, 1.6f}, 0.62f);
}

void build_robot(Builder& b) {
    const float w = b.rng.uniform(0.36f, 0.48f), leg = b.rng.uniform(0.4f, 0.6f), torso = b.rng.uniform(0.32f, 0.42f),
                head = b.rng.uniform(0.22f, 0.3f);
    for (const float s : {-1.0f, 1.0f}) {
        b.box(kLegs, {0, s * w * 0.5f, leg * 0.5f + 0.05f}, {0.12f, 0.13f, leg * 0.5f});
        b.box(kLegs, {0.07f, s * w * 0.5f, 0.07f}, {0.22f, 0.16f, 0.07f});
        const float swing = b.rng.uniform(-0.6f, 0.6f);
        const Mat3 r = rotation_y(swing);
        const Vec3 shoulder{0, s * (w + 0.13f), leg + torso * 1.7f};
        b.box(kArms, shoulder + r * Vec3{0, 0, -torso * 0.7f}, {0.09f, 0.1f, torso * 0.75f}, r);
        b.ball(kArms, shoulder + r * Vec3{0, 0, -torso * 1.5f}, 0.13f);
    }
    b.box(kBody, {0, 0, leg + torso}, {0.28f, w, torso});
    b.box(kButtons, {0.28f, 0, leg + torso * 1.15f}, {0.025f, w * 0.6f, torso * 0.42f})->shade = 0.8f;
    const float z = leg + 2 * torso + head + 0.05f;
    b.rod(kBody, {0, 0, leg + 2 * torso}, {0, 0, leg + 2 * torso + 0.1f}, 0.1f);
    b.box(kHead, {0, 0, z}, {0.26f, w * 0.75f, head});
    for (const float s : {-1.0f, 1.0f}) b.ball(kEyes, {0.26f, s * w * 0.34f, z + head * 0.2f}, 0.085f);
    b.box(kMouth, {0.26f, 0, z - head * 0.5f}, {0.02f, w * 0.4f, 0.035f})->shade = 0.4f;
    if (b.rng.chance(0.7f)) {
        b.rod(kAntenna, {0, 0, z + head}, {0, 0, z + head + 0.28f}, 0.03f);
        b.ball(kAntenna, {0, 0, z + head + 0.3f}, 0.075f);
    }
    b.anchor({0, 0, z + head}, w * 0.75f);
}

void build_snowman(Builder& b) {
    const float r = b.rng.uniform(0.55f, 0.65f), q = r * b.rng.uniform(0.68f, 0.78f), h = q * b.rng.uniform(0.7f, 0.8f);
    const float z1 = r * 0.92f, z2 = 1.84f * r + q * 0.6f, z3 = z2 + q * 0.75f + h * 0.7f;
    b.ball(kBody, {0, 0, z1}, r);
    b.ball(kBody, {0, 0, z2}, q);
    b.ball(kHead, {0, 0, z3}, h);
    b.rod(kNose, {h * 0.9f, 0, z3}, {h * 0.9f + 0.35f, 0, z3 - 0.03f}, 0.08f, 0.01f);
    for (const float s : {-1.0f, 1.0f}) {
        b.ball(kEyes, {h * 0.86f, s * h * 0.4f, z3 + h * 0.3f}, 0.06f);
        b.rod(kArms, {0, s * q * 0.9f, z2 + 0.05f}, {0.1f, s * (q + 0.55f), z2 + b.rng.uniform(0.1f, 0.4f)}, 0.04f,
              0.025f);
    }
    for (int i = 0; i < 3; ++i) b.ball(kButtons, {q * 0.97f, 0, z2 - 0.2f + 0.2f * static_cast<float>(i)}, 0.055f);
    if (b.rng.chance(0.5f)) b.ring(kScarf, {0, 0, z3 - h * 0.8f}, {0, 0, 1}, h * 0.75f, 0.1f);
    b.anchor({0, 0, z3 + h * 0.85f}, h);
}

void build_tree(Builder& b) {
    const int style = b.rng.below(3);
    const float h = b.rng.uniform(0.5f, 0.95f), r = b.rng.uniform(0.09f, 0.16f);
    b.rod(kTrunk, {0, 0, 0}, {0, 0, h + 0.4f}, r, r * 0.7f);
    if (style == 0) {  // fir
        const int tiers = b.rng.between(2, 4);
        float z = h * 0.6f, w = b.rng.uniform(0.55f, 0.75f);
        for (int i = 0; i < tiers; ++i) {
            b.rod(kLeaves, {0, 0, z}, {0, 0, z + w * 1.1f}, w, 0.02f);
            z += w * 0.62f;
            w *= 0.78f;
        }
    } else if (style == 1) {  // round crown of several balls
        const float crown = b.rng.uniform(0.45f, 0.6f);
        b.ball(kLeaves, {0, 0, h + crown}, crown);
        const int lumps = b.rng.between(4, 8);
        for (int i = 0; i < lumps; ++i) {
            const float a = b.rng.uniform(0, 6.28f), e = b.rng.uniform(-0.3f, 0.9f),
                        s = crown * b.rng.uniform(0.4f, 0.65f);
            b.ball(kLeaves, {crown * cosine(a) * 0.75f, crown * sine(a) * 0.75f, h + crown * (1 + e * 0.7f)}, s);
        }
    } else {  // branches with tufts
        const int branches = b.rng.between(4, 6);
        for (int i = 0; i < branches; ++i) {
            const float a = 2 * kPi * static_cast<float>(i) / static_cast<float>(branches) + b.rng.uniform(-0.3f, 0.3f);
            const Vec3 end{0.5f * cosine(a), 0.5f * sine(a), h + b.rng.uniform(0.3f, 0.8f)};
            b.rod(kTrunk, {0, 0, h * 0.9f}, end, r * 0.5f, r * 0.3f);
            b.ball(kLeaves, end, {0.34f, 0.34f, b.rng.uniform(0.2f, 0.34f)});
        }
        b.ball(kLeaves, {0, 0, h + 0.75f}, {0.36f, 0.36f, 0.3f});
    }
    if (b.rng.chance(0.15f)) {
        for (int i = 0; i < 7; ++i) {
            const float a = b.rng.uniform(0, 6.28f);
            b.ball(kFruit, {0.5f * cosine(a), 0.5f * sine(a), h + b.rng.uniform(0.3f, 0.8f)}, 0.09f);
        }
    }
}

void build_mushroom(Builder& b) {
    const float h = b.rng.uniform(0.5f, 0.9f), r = b.rng.uniform(0.6f, 0.8f), cap = b.rng.uniform(0.4f, 0.65f);
    b.rod(kStem, {0, 0, 0}, {0, 0, h + 0.05f}, r * 0.36f, r * 0.28f);
    b.dome(kCap, {0, 0, h}, {r, r, cap});
    const bool spots = b.rng.chance(0.6f);
    for (int i = 0; spots && i < 11; ++i) {
        const float a = b.rng.uniform(0, 6.28f), e = i == 0 ? 0.05f : b.rng.uniform(0.35f, 1.3f);
        const Vec3 n{sine(e) * cosine(a), sine(e) * sine(a), cosine(e)};
        b.ball(kSpots, Vec3{0, 0, h} + n * Vec3{r, r, cap}, {0.11f, 0.11f, 0.035f}, frame_along(n));
    }
}

void build_flower(Builder& b) {
    const float h = b.rng.uniform(0.9f, 1.4f), r = b.rng.uniform(0.16f, 0.24f);
    const Mat3 lean = rotation_z(b.rng.uniform(-0.4f, 0.4f)) * rotation_y(b.rng.uniform(0.4f, 1.2f));
    const Vec3 top{0, 0, h};
    b.rod(kStem, {0, 0, 0}, top, 0.05f);
    const int petals = b.rng.between(5, 8);
    for (int i = 0; i < petals; ++i) {
        const Mat3 m = lean * rotation_z(2 * kPi * static_cast<float>(i) / static_cast<float>(petals));
        b.ball(kPetals, top + m * Vec3{r * 1.75f, 0, 0.02f}, {r * 1.05f, r * 0.75f, 0.06f}, m);
    }
    b.ball(kHead, top + lean.c * 0.04f, {r * 0.95f, r * 0.95f, r * 0.5f}, lean);
    for (const float s : {-1.0f, 1.0f}) {
        const Mat3 m = rotation_z(b.rng.uniform(0, 3.0f) + (s > 0 ? kPi : 0.0f)) * rotation_y(-0.6f);
        b.ball(kLeaves, Vec3{0, 0, h * 0.3f} + m * Vec3{0.28f, 0, 0}, {0.28f, 0.11f, 0.03f}, m);
    }
    if (b.rng.chance(0.4f)) b.rod(kPot, {0, 0, -0.35f}, {0, 0, 0.08f}, 0.22f, 0.32f);
}

void build_duck(Builder& b) {
    const float l = b.rng.uniform(0.68f, 0.8f), w = b.rng.uniform(0.46f, 0.56f), h = b.rng.uniform(0.38f, 0.46f),
                r = b.rng.uniform(0.3f, 0.37f);
    b.ball(kBody, {0, 0, h}, {l, w, h});
    b.ball(kTail, {-l * 0.9f, 0, h * 1.45f}, {0.26f, 0.2f, 0.1f}, rotation_y(0.7f));
    const Vec3 head{l * 0.62f, 0, h * 1.75f + r * 0.6f};
    b.ball(kHead, head, r);
    b.ball(kBeak, head + Vec3{r * 1.1f, 0, -0.04f}, {0.2f, 0.15f, 0.06f});
    for (const float s : {-1.0f, 1.0f}) {
        b.ball(kEyes, head + Vec3{r * 0.72f, s * r * 0.5f, r * 0.35f}, 0.065f);
        b.ball(kWings, {-0.1f, s * w * 0.88f, h * 1.15f}, {0.4f, 0.12f, 0.22f}, rotation_y(-0.2f));
    }
    b.anchor(head + Vec3{0, 0, r * 0.9f}, r);
}

void build_cat(Builder& b) {
    const float w = b.rng.uniform(0.26f, 0.34f), leg = b.rng.uniform(0.3f, 0.42f), l = b.rng.uniform(0.55f, 0.68f),
                r = b.rng.uniform(0.29f, 0.36f);
    for (const float sx : {-0.8f, 0.8f}) {
        for (const float sy : {-0.6f, 0.6f}) b.rod(kLegs, {sx * l, sy * w, 0}, {sx * l, sy * w, leg + 0.1f}, 0.09f);
    }
    b.ball(kBody, {0, 0, leg + w * 0.8f}, {l + 0.12f, w, w * 0.95f});
    const Vec3 head{l + 0.14f, 0, leg + w * 1.7f + r * 0.35f};
    b.ball(kHead, head, {r * 0.9f, r, r * 0.88f});
    for (const float s : {-1.0f, 1.0f}) {
        b.rod(kEars, head + Vec3{0, s * r * 0.55f, r * 0.6f}, head + Vec3{0, s * r * 0.75f, r * 1.35f}, 0.14f, 0.01f);
        b.ball(kEyes, head + Vec3{r * 0.78f, s * r * 0.42f, r * 0.2f}, 0.06f);
    }
    b.ball(kNose, head + Vec3{r * 0.92f, 0, -0.05f}, 0.055f);
    const float up = b.rng.uniform(0.2f, 0.7f);
    b.rod(kTail, {-l, 0, leg + w}, {-l - 0.35f, 0, leg + w + up}, 0.07f, 0.05f);
    b.rod(kTail, {-l - 0.35f, 0, leg + w + up}, {-l - 0.3f, 0, leg + w + up + 0.3f}, 0.05f);
    b.anchor(head + Vec3{0, 0, r * 0.85f}, r * 0.8f);
}

}  // namespace

std::vector<ShapeInfo> living_shapes() {
    const PartRule eyes{kEyes, .97f, bit(kBlack) | bit(kWhite), true};
    return {
        {"monkey head",
         "monkey heads",
         {"monkey", "ape head"},
         {{kEyes, .95f, bit(kWhite), true},
          {kEars, .2f, 0, true},
          {kMuzzle, .4f, bit(kPink) | bit(kBrown) | bit(kOrange) | bit(kWhite), true},
          {kHead, 0, 0, false}},
         build_monkey,
         false,
         true,
         bit(kBrown) | bit(kGrey) | bit(kOrange),
         1.3f},
        {"robot",
         "robots",
         {},
         {{kEyes, .95f, bit(kYellow) | bit(kBlue) | bit(kRed) | bit(kBlack), true},
          {kArms, .4f, 0, true},
          {kLegs, .3f, 0, true},
          {kHead, .25f, 0, true},
          {kAntenna, .6f, bit(kRed) | bit(kYellow), true},
          {kButtons, .7f, 0, false}},
         build_robot,
         false,
         true,
         bit(kGrey) | bit(kBlue) | bit(kRed)},
        {"snowman",
         "snowmen",
         {},
         {{kNose, .97f, bit(kOrange), true},
          {kEyes, .97f, bit(kBlack), true},
          {kArms, .9f, bit(kBrown) | bit(kBlack), true},
          {kScarf, .95f, bit(kRed) | bit(kBlue) | bit(kGreen), true},
          {kButtons, .95f, bit(kBlack), true},
          {kHead, 0, 0, true}},
         build_snowman,
         false,
         true,
         bit(kWhite)},
        {"tree",
         "trees",
         {},
         {{kTrunk, .85f, bit(kBrown) | bit(kGrey), true},
          {kFruit, .98f, bit(kRed) | bit(kYellow) | bit(kOrange), true},
          {kLeaves, 0, 0, false}},
         build_tree,
         false,
         false,
         bit(kGreen),
         1.2f},
        {"mushroom",
         "mushrooms",
         {},
         {{kStem, .85f, bit(kWhite) | bit(kBrown), true},
          {kSpots, .98f, bit(kWhite) | bit(kYellow), true},
          {kCap, 0, 0, false}},
         build_mushroom,
         false,
         true,
         bit(kRed) | bit(kBrown)},
        {"flower",
         "flowers",
         {},
         {{kStem, .95f, bit(kGreen), false},
          {kLeaves, .97f, bit(kGreen), true},
          {kHead, .8f, bit(kYellow) | bit(kBrown) | bit(kOrange), false},
          {kPot, .9f, bit(kBrown) | bit(kOrange) | bit(kWhite), true},
          {kPetals, 0, 0, true}},
         build_flower,
         false,
         false},
        {"duck",
         "ducks",
         {"rubber duck"},
         {{kBeak, .95f, bit(kOrange) | bit(kRed), false},
          eyes,
          {kWings, .2f, 0, true},
          {kTail, .1f, 0, true},
          {kHead, .12f, bit(kGreen) | bit(kWhite), true}},
         build_duck,
         false,
         true,
         bit(kYellow) | bit(kWhite)},
        {"cat",
         "cats",
         {"kitten"},
         {eyes,
          {kEars, .2f, 0, true},
          {kTail, .25f, 0, true},
          {kLegs, .2f, 0, true},
          {kNose, .9f, bit(kPink) | bit(kBlack), false},
          {kHead, .12f, 0, true}},
         build_cat,
         false,
         true,
         bit(kBlack) | bit(kWhite) | bit(kGrey) | bit(kOrange)},
    };
}

}  // namespace fieldgraft::generator
