// The bulldozer, with a blade or a lifted bucket, closed or open cab, and many small pieces. The front is +x.
#include "models/generator/shapes.h"

namespace fieldgraft::generator {
namespace {

// An endless track on one side: rounded ends, a flat run, ribs and road wheels.
void track(Builder& b, float y, float length, float radius, float half_width) {
    for (const float sx : {-1.0f, 1.0f}) {
        b.rod(kTracks, {sx * length, y - half_width, radius}, {sx * length, y + half_width, radius}, radius);
        b.rod(kTracks, {sx * length, y - half_width * 1.1f, radius}, {sx * length, y + half_width * 1.1f, radius},
              radius * 0.5f)
            ->shade = 1.9f;
    }
    b.box(kTracks, {0, y, radius}, {length, half_width, radius})->shade = 0.8f;
    const int ribs = 7;
    for (int i = 0; i < ribs; ++i) {
        const float x = length * (-1.1f + 2.2f * static_cast<float>(i) / static_cast<float>(ribs - 1));
        b.box(kTracks, {x, y, 2 * radius}, {length * 0.09f, half_width * 1.08f, radius * 0.12f})->shade = 1.35f;
    }
    for (int i = 0; i < 2; ++i) {
        const float x = length * (-0.33f + 0.66f * static_cast<float>(i));
        b.rod(kTracks, {x, y - half_width * 1.1f, radius * 0.75f}, {x, y + half_width * 1.1f, radius * 0.75f},
              radius * 0.45f)
            ->shade = 1.7f;
    }
}

void bulldozer_blade(Builder& b, float reach, float width, float height, float lift) {
    const float lean = b.rng.uniform(-0.1f, 0.25f);
    const Mat3 r = rotation_y(-lean);
    const Vec3 at{reach, 0, lift + height};
    b.box(kBlade, at, {0.05f, width, height}, r);
    // The curl at the upper and lower edge.
    b.box(kBlade, at + r * Vec3{0.07f, 0, height}, {0.09f, width, 0.04f}, r * rotation_y(-0.5f));
    b.box(kBlade, at + r * Vec3{0.08f, 0, -height}, {0.09f, width, 0.04f}, r * rotation_y(0.5f));
    for (const float s : {-1.0f, 1.0f}) b.box(kBlade, at + r * Vec3{0.05f, s * width, 0}, {0.12f, 0.03f, height}, r);
    if (b.rng.chance(0.5f)) {
        for (const float s : {-0.5f, 0.5f})
            b.box(kBlade, at + r * Vec3{-0.07f, s * width, 0}, {0.04f, 0.05f, height * 0.8f}, r);
    }
}

void bulldozer_body(Builder& b, float w, float deck) {
    const bool studs = b.rng.chance(0.6f);
    const float hood = b.rng.uniform(0.2f, 0.32f), hood_width = w * b.rng.uniform(0.55f, 0.9f);
    b.box(kBody, {0, 0, deck}, {0.85f, w * 0.85f, 0.14f});
    b.box(kBody, {0.42f, 0, deck + 0.12f + hood}, {0.45f, hood_width, hood});
    if (studs) b.pattern(0.13f);
    b.box(kEngine, {0.8f, 0, deck + 0.1f + hood * 0.9f}, {0.1f, hood_width * 0.85f, hood * 0.8f})->shade = 0.75f;
    b.pattern(0.07f);
    b.greebles(kBody, {0.42f, 0, deck + 0.12f + 2 * hood}, {0.42f, hood_width, 0}, b.rng.between(1, 7));
    // Rear deck with its own clutter of pieces, often a ripper.
    const float rear = b.rng.uniform(0.1f, 0.3f);
    b.box(kBody, {-0.72f, 0, deck + 0.1f + rear}, {0.2f, w * 0.75f, rear});
    if (studs) b.pattern(0.13f);
    b.greebles(kBody, {-0.72f, 0, deck + 0.1f + 2 * rear}, {0.2f, w * 0.7f, 0}, b.rng.between(0, 4));
    if (b.rng.chance(0.45f)) {
        b.box(kBody, {-1.02f, 0, deck + 0.12f}, {0.14f, w * 0.3f, 0.06f});
        for (const float s : {-0.25f, 0.25f})
            b.rod(kBody, {-1.1f, s, deck + 0.15f}, {-1.16f, s, deck - 0.25f}, 0.05f, 0.03f);
    }
    if (b.rng.chance(0.6f))
        b.rod(kExhaust, {0.3f, hood_width * 0.7f, deck + 2 * hood}, {0.3f, hood_width * 0.7f, deck + 2 * hood + 0.5f},
              0.05f);
}

void bulldozer_cab(Builder& b, float w, float deck) {
    const float h = b.rng.uniform(0.32f, 0.5f), cw = w * b.rng.uniform(0.55f, 0.8f), x = b.rng.uniform(-0.4f, -0.2f);
    const float base = deck + 0.12f;
    if (b.rng.chance(0.5f)) {  // closed cab with panes
        b.box(kCab, {x, 0, base + h}, {0.28f, cw, h});
        b.box(kWindows, {x + 0.28f, 0, base + 1.35f * h}, {0.02f, cw * 0.8f, h * 0.42f});
        for (const float s : {-1.0f, 1.0f}) b.box(kWindows, {x, s * cw, base + 1.35f * h}, {0.2f, 0.02f, h * 0.42f});
        b.box(kWindows, {x - 0.28f, 0, base + 1.35f * h}, {0.02f, cw * 0.7f, h * 0.36f});
    } else {  // posts, seat, roof
        for (const float sx : {-1.0f, 1.0f}) {
            for (const float sy : {-1.0f, 1.0f})
                b.box(kCab, {x + sx * 0.25f, sy * cw * 0.92f, base + h}, {0.04f, 0.04f, h});
        }
        b.box(kSeat, {x - 0.05f, 0, base + 0.15f}, {0.14f, cw * 0.45f, 0.12f});
        b.box(kSeat, {x - 0.17f, 0, base + 0.4f}, {0.04f, cw * 0.45f, 0.2f});
        b.box(kCab, {x, 0, base + 0.08f}, {0.28f, cw, 0.1f});
    }
    b.box(kRoof, {x, 0, base + 2 * h + 0.04f}, {0.34f, cw * 1.12f, 0.05f});
    if (b.rng.chance(0.5f)) b.pattern(0.13f);
    if (b.rng.chance(0.4f)) b.rod(kLights, {x, 0, base + 2 * h}, {x, 0, base + 2 * h + 0.2f}, 0.07f);
    b.anchor({x, 0, base + 2 * h + 0.09f}, cw);
}

// A bucket that is open to the front, with teeth, lifted and tipped by its arms.
void raised_bucket(Builder& b, Vec3 at, float width, float depth, float tip) {
    const Mat3 r = rotation_y(tip);
    const float wall = 0.035f, high = depth * b.rng.uniform(0.8f, 1.1f);
    b.box(kBlade, at + r * Vec3{-depth, 0, 0}, {wall, width, high}, r);
    b.box(kBlade, at + r * Vec3{0, 0, -high}, {depth, width, wall}, r);
    b.box(kBlade, at + r * Vec3{-depth * 0.55f, 0, high}, {depth * 0.5f, width, wall}, r);
    for (const float s : {-1.0f, 1.0f}) {
        b.box(kBlade, at + r * Vec3{-depth * 0.2f, s * width, -high * 0.3f}, {depth * 0.8f, wall, high * 0.7f}, r);
    }
    const int teeth = b.rng.between(0, 6);
    for (int i = 0; i < teeth; ++i) {
        const float y = width * (-0.85f + 1.7f * (static_cast<float>(i) + 0.5f) / static_cast<float>(teeth));
        b.box(kBlade, at + r * Vec3{depth * 1.12f, y, -high}, {depth * 0.16f, width * 0.07f, wall}, r)->shade = 0.85f;
    }
}

// Lift arms with a bucket held up in front or over the hood.
void loader_front(Builder& b, float w, float deck, float len) {
    const float up = b.rng.uniform(0.6f, 1.7f), reach = len + b.rng.uniform(0.2f, 0.75f),
                arm = w * b.rng.uniform(0.55f, 0.95f);
    const Vec3 at{reach, 0, deck + up};
    raised_bucket(b, at, w * b.rng.uniform(1.1f, 1.6f), b.rng.uniform(0.25f, 0.36f), b.rng.uniform(-0.9f, 0.4f));
    for (const float s : {-1.0f, 1.0f}) {
        const Vec3 elbow{0.35f * reach, s * arm, deck + 0.55f * up + 0.25f};
        b.rod(kLift, {-0.25f, s * arm, deck + 0.25f}, elbow, 0.065f);
        b.rod(kLift, elbow, at + Vec3{-0.25f, s * arm, -0.05f}, 0.055f);
        b.rod(kLift, {0.5f, s * arm * 0.6f, deck + 0.2f}, at + Vec3{-0.35f, s * arm * 0.6f, 0.1f}, 0.035f)->shade =
            1.3f;
        b.rod(kLift, {0.1f, s * arm, deck + 0.3f}, elbow + Vec3{0.2f, 0, -0.1f}, 0.04f)->shade = 0.6f;
    }
}

void blade_front(Builder& b, float w, float deck, float len, float r, float tw) {
    const float reach = len + r + b.rng.uniform(0.25f, 0.5f),
                lift = b.rng.chance(0.3f) ? b.rng.uniform(0.1f, 0.5f) : 0.02f;
    const float height = b.rng.uniform(0.24f, 0.4f), width = w + tw + b.rng.uniform(0.05f, 0.2f);
    bulldozer_blade(b, reach, width, height, lift);
    for (const float s : {-1.0f, 1.0f}) {
        const float y = s * (w + tw * 1.5f);
        b.rod(kLift, {-0.1f, y, r * 1.1f}, {reach - 0.05f, y * 0.95f, lift + height * 0.6f}, 0.06f);
        b.rod(kLift, {0.5f, s * w * 0.5f, deck + 0.3f}, {reach - 0.05f, s * w * 0.5f, lift + height * 1.5f}, 0.045f)
            ->shade = 1.2f;
    }
}

}  // namespace

void build_bulldozer(Builder& b) {
    const float w = b.rng.uniform(0.42f, 0.68f), r = b.rng.uniform(0.18f, 0.3f), tw = b.rng.uniform(0.1f, 0.18f);
    const float len = b.rng.uniform(0.6f, 0.85f), deck = 2 * r + b.rng.uniform(0.02f, 0.14f);
    for (const float s : {-1.0f, 1.0f}) track(b, s * (w + tw * 0.4f), len, r, tw);
    bulldozer_body(b, w, deck);
    bulldozer_cab(b, w, deck);
    if (b.rng.chance(0.4f))
        loader_front(b, w, deck, len);
    else
        blade_front(b, w, deck, len, r, tw);
    if (b.rng.chance(0.4f)) {
        for (const float s : {-1.0f, 1.0f}) b.ball(kLights, {0.88f, s * 0.3f, deck + 0.6f}, 0.07f);
    }
    // Loose pieces between the tracks and on the flanks: dark gaps and small details.
    for (int i = b.rng.between(2, 10); i > 0; --i) {
        const Vec3 at{b.rng.uniform(-0.8f, 0.8f), b.rng.uniform(-1.0f, 1.0f) * w, deck + b.rng.uniform(-0.05f, 0.4f)};
        b.box(b.rng.chance(0.5f) ? kEngine : kBody, at,
              {b.rng.uniform(0.04f, 0.14f), b.rng.uniform(0.03f, 0.1f), b.rng.uniform(0.03f, 0.1f)})
            ->shade = b.rng.uniform(0.35f, 1.1f);
    }
}

}  // namespace fieldgraft::generator
