// Mug, bottle, vase, microphone, hat, crown, drum, castle, umbrella.
#include "models/generator/shapes.h"

namespace fieldgraft::generator {
namespace {

void build_mug(Builder& b) {
    const float r = b.rng.uniform(0.5f, 0.65f), h = b.rng.uniform(0.95f, 1.35f), top = b.rng.uniform(0.98f, 1.0f);
    Primitive* wall = b.rod(kBody, {0, 0, 0}, {0, 0, h}, r, r * top);
    wall->open = true;
    b.rod(kBody, {0, 0, 0.03f}, {0, 0, h * 0.55f}, r * 0.93f)->shade = 0.35f;  // the dark inside
    b.ring(kBody, {0, 0, h}, {0, 0, 1}, r * 0.97f, 0.045f);
    b.ring(kHandle, {r, 0, h * 0.52f}, {0, 1, 0}, h * b.rng.uniform(0.26f, 0.32f), b.rng.uniform(0.07f, 0.1f));
}

void build_bottle(Builder& b) {
    const float r = b.rng.uniform(0.3f, 0.42f), h = b.rng.uniform(0.8f, 1.15f), neck = r * b.rng.uniform(0.3f, 0.42f),
                tall = b.rng.uniform(0.35f, 0.6f);
    b.rod(kBody, {0, 0, 0}, {0, 0, h}, r);
    b.dome(kBody, {0, 0, h}, {r, r, r * b.rng.uniform(0.7f, 1.1f)});
    b.rod(kBody, {0, 0, h}, {0, 0, h + r + tall}, neck);
    b.rod(kCap, {0, 0, h + r + tall * 0.85f}, {0, 0, h + r + tall + 0.12f}, neck * 1.2f);
    b.rod(kLabel, {0, 0, h * 0.3f}, {0, 0, h * 0.75f}, r * 1.025f);
}

void build_vase(Builder& b) {
    const float r = b.rng.uniform(0.45f, 0.6f), h = b.rng.uniform(0.5f, 0.7f), neck = r * b.rng.uniform(0.4f, 0.6f);
    b.rod(kBase, {0, 0, 0}, {0, 0, 0.12f}, r * 0.65f, r * 0.6f);
    b.ball(kBody, {0, 0, h * 0.95f}, {r, r, h * 0.9f});
    b.rod(kBody, {0, 0, h * 1.5f}, {0, 0, h * 2.2f}, neck);
    b.rod(kBody, {0, 0, h * 2.1f}, {0, 0, h * 2.45f}, neck, neck * 1.6f);
    b.rod(kBody, {0, 0, h * 2.44f}, {0, 0, h * 2.455f}, neck * 1.35f)->shade = 0.3f;
    if (b.rng.chance(0.4f)) {
        for (const float s : {-1.0f, 1.0f}) b.ring(kHandle, {0, s * r * 0.85f, h * 1.55f}, {1, 0, 0}, h * 0.36f, 0.06f);
    }
}

void build_microphone(Builder& b) {
    const float r = b.rng.uniform(0.28f, 0.36f), l = b.rng.uniform(0.9f, 1.3f);
    const bool stand = b.rng.chance(0.6f);
    const Mat3 m = rotation_y(stand ? b.rng.uniform(0.4f, 1.1f) : b.rng.uniform(-0.2f, 1.4f));
    const Vec3 at{0, 0, stand ? 1.5f : 0.0f};
    b.rod(kHandle, at, at + m * Vec3{0, 0, l}, r * 0.45f, r * 0.72f);
    b.rod(kHandle, at + m * Vec3{0, 0, l}, at + m * Vec3{0, 0, l + 0.09f}, r * 0.98f)->shade = 0.75f;
    b.ball(kMesh, at + m * Vec3{0, 0, l + r * 0.85f}, {r, r, r * 1.1f}, m);
    b.pattern(0.09f);
    if (stand) {
        b.rod(kStand, {m.c.x * l * 0.35f, 0, 0.1f}, {m.c.x * l * 0.35f, 0, 1.5f + m.c.z * l * 0.35f}, 0.05f);
        b.rod(kBase, {m.c.x * l * 0.35f, 0, 0}, {m.c.x * l * 0.35f, 0, 0.1f}, 0.5f, 0.42f);
    }
}

void build_hat(Builder& b) {
    const float r = b.rng.uniform(0.48f, 0.58f), brim = b.rng.uniform(0.8f, 1.05f);
    const int style = b.rng.below(3);
    b.rod(kBrim, {0, 0, 0}, {0, 0, 0.07f}, brim);
    if (style == 0) {  // top hat
        const float h = b.rng.uniform(0.75f, 1.1f);
        b.rod(kBody, {0, 0, 0.05f}, {0, 0, h}, r * 1.05f);
        b.rod(kBand, {0, 0, 0.07f}, {0, 0, 0.28f}, r * 1.08f);
    } else if (style == 1) {  // bowler
        b.dome(kBody, {0, 0, 0.2f}, {r, r, 0.5f});
        b.rod(kBand, {0, 0, 0.05f}, {0, 0, 0.24f}, r * 1.03f);
    } else {  // cowboy or sun hat
        b.rod(kBody, {0, 0, 0.05f}, {0, 0, 0.55f}, r, r * 0.75f);
        b.rod(kBand, {0, 0, 0.06f}, {0, 0, 0.2f}, r * 1.05f);
    }
}

void build_crown(Builder& b) {
    const float r = b.rng.uniform(0.75f, 0.9f), h = b.rng.uniform(0.3f, 0.45f), tip = b.rng.uniform(0.35f, 0.55f);
    Primitive* wall = b.rod(kBody, {0, 0, 0}, {0, 0, h}, r);
    wall->open = true;
    const int points = b.rng.between(5, 8);
    for (int i = 0; i < points; ++i) {
        const float a = 2 * kPi * static_cast<float>(i) / static_cast<float>(points);
        const Mat3 m = rotation_z(a);
        b.gable(kPoints, m * Vec3{r * 0.98f, 0, h + tip * 0.5f},
                {r * 2.9f / static_cast<float>(points), 0.06f, tip * 0.5f}, m * rotation_z(0.5f * kPi));
        b.ball(kJewels, m * Vec3{r, 0, h + tip}, 0.09f);
        b.ball(kJewels, rotation_z(a + 0.35f) * Vec3{r, 0, h * 0.5f}, 0.085f);
    }
    b.ring(kBody, {0, 0, 0.05f}, {0, 0, 1}, r, 0.06f);
}

void build_drum(Builder& b) {
    const float r = b.rng.uniform(0.7f, 0.85f), h = b.rng.uniform(0.6f, 1.1f);
    b.rod(kBody, {0, 0, 0.05f}, {0, 0, h}, r);
    b.ring(kFrame, {0, 0, 0.06f}, {0, 0, 1}, r * 1.01f, 0.06f);
    b.ring(kFrame, {0, 0, h}, {0, 0, 1}, r * 1.01f, 0.06f);
    b.rod(kSkins, {0, 0, h - 0.01f}, {0, 0, h + 0.02f}, r * 0.97f);
    for (int i = 0; i < 8; ++i) {
        const float a = 2 * kPi * static_cast<float>(i) / 8.0f, c = a + 0.39f;
        b.rod(kFrame, {r * 1.02f * cosine(a), r * 1.02f * sine(a), 0.08f},
              {r * 1.02f * cosine(c), r * 1.02f * sine(c), h}, 0.025f);
    }
    b.anchor({0, 0, h + 0.02f}, r * 0.8f);
}

void build_castle(Builder& b) {
    const float w = b.rng.uniform(0.65f, 0.8f), h = b.rng.uniform(0.3f, 0.42f), tower = b.rng.uniform(0.55f, 0.75f),
                r = b.rng.uniform(0.2f, 0.26f);
    b.box(kBody, {0, 0, h}, {w, w, h});
    const bool pointed = b.rng.chance(0.6f);
    for (const float sx : {-1.0f, 1.0f}) {
        for (const float sy : {-1.0f, 1.0f}) {
            const Vec3 at{sx * w, sy * w, 0};
            b.rod(kTowers, at, at + Vec3{0, 0, 2 * tower}, r);
            if (pointed)
                b.rod(kRoof, at + Vec3{0, 0, 2 * tower}, at + Vec3{0, 0, 2 * tower + 0.5f}, r * 1.25f, 0.01f);
            else
                b.rod(kTowers, at + Vec3{0, 0, 2 * tower}, at + Vec3{0, 0, 2 * tower + 0.15f}, r * 1.22f);
        }
        for (const float t : {-0.4f, 0.0f, 0.4f}) {
            b.box(kBody, {sx * w, t * w, 2 * h + 0.06f}, {0.06f, w * 0.12f, 0.09f});
            b.box(kBody, {t * w, sx * w, 2 * h + 0.06f}, {w * 0.12f, 0.06f, 0.09f});
        }
    }
    b.box(kDoor, {w, 0, h * 0.6f}, {0.03f, 0.2f, h * 0.6f});
    if (b.rng.chance(0.5f)) {
        b.rod(kTowers, {0, 0, h}, {0, 0, 2 * tower + 0.35f}, r * 1.2f);
        if (pointed) b.rod(kRoof, {0, 0, 2 * tower + 0.35f}, {0, 0, 2 * tower + 0.9f}, r * 1.4f, 0.01f);
    }
    b.anchor({0, 0, 2 * h}, w * 0.8f);
}

void build_umbrella(Builder& b) {
    const float r = b.rng.uniform(0.8f, 1.0f), h = b.rng.uniform(1.1f, 1.5f), cap = b.rng.uniform(0.4f, 0.6f);
    b.dome(kBody, {0, 0, h}, {r, r, cap});
    const bool hooked = b.rng.chance(0.6f);
    b.rod(kHandle, {0, 0, 0.1f}, {0, 0, h + cap + 0.12f}, 0.045f);
    if (hooked) b.ring(kHandle, {0.13f, 0, 0.12f}, {0, 1, 0}, 0.13f, 0.05f);
    b.rod(kHandle, {0, 0, h + cap}, {0, 0, h + cap + 0.14f}, 0.05f, 0.02f);
}

}  // namespace

std::vector<ShapeInfo> thing_shapes() {
    const uint32_t dark = bit(kBlack) | bit(kGrey);
    return {
        {"mug", "mugs", {"cup", "coffee mug"}, {{kHandle, .15f, 0, true}}, build_mug},
        {"bottle",
         "bottles",
         {},
         {{kCap, .6f, 0, true}, {kLabel, .7f, bit(kWhite) | bit(kRed) | bit(kYellow), true}},
         build_bottle,
         false,
         true,
         bit(kGreen) | bit(kBrown)},
        {"vase", "vases", {}, {{kHandle, .15f, 0, true}, {kBase, .15f, 0, false}}, build_vase, false, false},
        {"microphone",
         "microphones",
         {"mic"},
         {{kMesh, .75f, dark | bit(kWhite), true},
          {kStand, .5f, dark, true},
          {kBase, .5f, dark, false},
          {kHandle, 0, 0, false}},
         build_microphone,
         false,
         false,
         dark},
        {"hat",
         "hats",
         {},
         {{kBand, .85f, bit(kBlack) | bit(kRed) | bit(kWhite) | bit(kYellow), true}, {kBrim, .08f, 0, true}},
         build_hat,
         false,
         true},
        {"crown",
         "crowns",
         {},
         {{kJewels, .9f, bit(kRed) | bit(kBlue) | bit(kGreen), true}, {kPoints, 0, 0, false}},
         build_crown,
         false,
         false,
         bit(kYellow)},
        {"drum",
         "drums",
         {},
         {{kFrame, .75f, dark | bit(kWhite) | bit(kYellow), false}, {kSkins, .92f, bit(kWhite), false}},
         build_drum},
        {"castle",
         "castles",
         {},
         {{kRoof, .8f, bit(kRed) | bit(kBlue) | bit(kBlack), false},
          {kDoor, .85f, bit(kBrown) | bit(kBlack), true},
          {kTowers, .1f, 0, true}},
         build_castle,
         false,
         true,
         bit(kGrey)},
        {"umbrella",
         "umbrellas",
         {"parasol"},
         {{kHandle, .7f, bit(kBrown) | bit(kBlack), true}},
         build_umbrella,
         false,
         false},
    };
}

}  // namespace fieldgraft::generator
