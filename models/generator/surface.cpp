#include "models/generator/surface.h"

namespace fieldgraft::generator {
namespace {

struct Uv {
    float u, v;
};

// The two coordinates along a face, by the normal's largest component.
Uv face_coordinates(Vec3 q, Vec3 n) {
    const Vec3 a = absolute(n);
    if (a.z >= a.x && a.z >= a.y) return {q.x, q.y};
    if (a.x >= a.y) return {q.y, q.z};
    return {q.x, q.z};
}

float fraction(float x) {
    return x - std::floor(x);
}

void paint_plain(const Paint& p, Vec3 q, Surface& s) {
    s.albedo = p.base * (0.94f + 0.12f * noise(q * 3.0f + p.offset));
    s.specular = 0.02f + 0.06f * p.gloss;
    s.sharpness = p.gloss > 0.5f ? 5 : 3;
}

void paint_wood(const Paint& p, Vec3 q, Surface& s) {
    const float f = 5.5f * p.scale;
    const float along = q[p.axis], across = p.axis == 2 ? q.x + 0.4f * q.y : q.z + 0.35f * (p.axis == 0 ? q.y : q.x);
    const float warp = noise(Vec3{across * 1.6f, along * 0.55f, q.y * 0.7f} + p.offset);
    const float ring = 0.5f + 0.5f * sine(2 * kPi * (across * f * 0.5f + warp * 2.6f));
    const float grain = noise(Vec3{across * 26.0f, along * 2.2f, q.y * 9.0f} + p.offset);
    const Vec3 pale{0.50f, 0.275f, 0.105f}, dark{0.175f, 0.065f, 0.02f};
    const float t = clamp01(0.62f * ring * ring + 0.38f * grain);
    const float tone = 0.65f + 0.55f * p.amount;
    s.albedo = mix(pale, dark, t) * tone;
    s.specular = 0.03f;
}

void paint_marble(const Paint& p, Vec3 q, Surface& s) {
    const Vec3 w = q * (0.95f * p.scale) + p.offset;
    const float turbulence = noise2(w * 1.3f) + 0.5f * noise(w * 3.1f);
    const float vein = std::fabs(sine(3.0f * (w.x + w.y * 0.6f + w.z * 0.8f) + 7.0f * turbulence));
    const float thin = 1.0f - smoothstep(0.0f, 0.4f, vein);
    const float cloud = noise(w * 2.0f + Vec3{9, 9, 9});
    s.albedo = mix(Vec3{0.88f, 0.86f, 0.84f}, Vec3{0.55f, 0.55f, 0.58f}, cloud * 0.5f);
    s.albedo = mix(s.albedo, {0.07f, 0.07f, 0.09f}, thin * 0.9f);
    s.specular = 0.06f;
    s.sharpness = 6;
}

void paint_brick(const Paint& p, Vec3 q, Vec3 n, Surface& s) {
    const Uv uv = face_coordinates(q, n);
    const float high = (0.15f + 0.09f * p.amount), wide = high * 2.1f;
    const float row = std::floor(uv.v / high);
    const float u = uv.u / wide + (static_cast<int>(row) & 1 ? 0.5f : 0.0f);
    const float fu = fraction(u), fv = fraction(uv.v / high);
    const float tone = lattice(static_cast<int>(std::floor(u)), static_cast<int>(row), 5);
    const bool mortar = fu < 0.085f || fv < 0.17f;
    const Vec3 brick = mix(Vec3{0.42f, 0.095f, 0.045f}, Vec3{0.21f, 0.045f, 0.03f}, tone);
    s.albedo = mortar ? Vec3{0.52f, 0.49f, 0.44f} : brick * (0.8f + 0.4f * noise(q * 14.0f + p.offset));
    s.specular = 0.01f;
}

void paint_rusty(const Paint& p, Vec3 q, Surface& s) {
    const float patch = noise2(q * (2.2f * p.scale) + p.offset) + 0.3f * noise(q * 8.0f + p.offset);
    const float cover = smoothstep(0.60f, 0.72f, patch + 0.06f + 0.14f * p.amount);
    const float grit = noise(q * 18.0f + p.offset);
    const Vec3 rust = mix(Vec3{0.36f, 0.12f, 0.025f}, Vec3{0.10f, 0.03f, 0.012f}, grit);
    const Vec3 old = p.colour >= 0 ? p.base * 0.75f : Vec3{0.24f, 0.24f, 0.25f};
    s.albedo = mix(old, rust, cover);
    s.specular = 0.02f;
}

void paint_mossy(const Paint& p, Vec3 q, Vec3 n, Surface& s) {
    const float patch = noise2(q * (2.4f * p.scale) + p.offset) + 0.28f * n.z;
    const float cover = smoothstep(0.44f, 0.56f, patch + 0.12f * p.amount);
    const float tuft = noise(q * 13.0f + p.offset);
    const Vec3 moss = mix(Vec3{0.05f, 0.11f, 0.01f}, Vec3{0.19f, 0.31f, 0.03f}, tuft);
    const Vec3 stone = p.colour >= 0 ? p.base * 0.7f : Vec3{0.2f, 0.19f, 0.17f};
    s.albedo = mix(stone * (0.8f + 0.4f * tuft), moss, cover);
    s.bump = Vec3{tuft - 0.5f, noise(q * 13.0f + p.offset + Vec3{5, 5, 5}) - 0.5f, 0} * (0.8f * cover);
    s.specular = 0.0f;
}

void paint_snow(const Paint& p, Vec3 q, Vec3 n, Surface& s) {
    paint_plain(p, q, s);
    const float edge = noise2(q * 4.0f + p.offset);
    s.snow = smoothstep(0.38f, 0.5f, n.z * 0.72f + 0.75f * edge - 0.24f + 0.2f * p.amount);
    const Vec3 white = Vec3{0.93f, 0.95f, 1.0f} * (0.9f + 0.15f * noise(q * 9.0f + p.offset));
    s.albedo = mix(s.albedo, white, s.snow);
    s.specular *= 1.0f - s.snow;
    s.emission = Vec3{0.10f, 0.11f, 0.13f} * s.snow;
}

void paint_burning(const Paint& p, Vec3 q, Surface& s) {
    const float char_noise = noise2(q * 3.0f + p.offset);
    const Vec3 body = p.colour >= 0 ? p.base : Vec3{0.25f, 0.2f, 0.17f};
    s.albedo = mix(body * 0.7f, {0.012f, 0.01f, 0.009f}, smoothstep(0.42f, 0.6f, char_noise + 0.06f));
    const float glow = smoothstep(0.58f, 0.72f, noise2(q * 4.3f + p.offset + Vec3{3, 8, 1}));
    s.emission = mix(Vec3{0.9f, 0.16f, 0.01f}, Vec3{1.0f, 0.6f, 0.08f}, glow) * (glow * 0.95f);
    s.specular = 0.01f;
}

void paint_pattern(const Paint& p, Vec3 q, Vec3 n, Surface& s) {
    if (p.ground_stuff) {
        const float f = 1.6f * p.scale;
        const bool odd = ((static_cast<int>(std::floor(q.x * f)) + static_cast<int>(std::floor(q.y * f))) & 1) != 0;
        s.albedo = odd ? p.base : p.second;
        return;
    }
    s.specular = 0.04f;
    if (p.material == kStriped) {
        const float period = 0.34f + 0.3f * p.amount;
        const float t = p.axis == 2 ? q.z : p.axis == 0 ? q.x + 0.25f * q.z : q.y - 0.25f * q.z;
        s.albedo = fraction(t / period + p.offset.x) < 0.52f ? p.base : p.second;
        return;
    }
    const Uv uv = face_coordinates(q, n);
    const float pitch = 0.34f + 0.16f * p.amount;
    const float row = std::floor(uv.v / pitch + p.offset.y);
    const float du = fraction(uv.u / pitch + p.offset.x + 0.5f * fraction(row * 0.5f) * 2.0f) - 0.5f;
    const float dv = fraction(uv.v / pitch + p.offset.y) - 0.5f;
    s.albedo = du * du + dv * dv < 0.29f * 0.29f ? p.second : p.base;
}

}  // namespace

Surface surface_at(const Paint& p, Vec3 q, Vec3 n) {
    Surface s;
    switch (p.material) {
        case kGold:
            s.albedo = {1.0f, 0.62f + 0.1f * p.amount, 0.13f + 0.13f * p.amount};
            s.metal = 1.0f;
            break;
        case kSilver:
            s.albedo = {0.90f, 0.91f, 0.93f};
            s.metal = 1.0f;
            break;
        case kWood:
            paint_wood(p, q, s);
            break;
        case kMarble:
            paint_marble(p, q, s);
            break;
        case kBrick:
            paint_brick(p, q, n, s);
            break;
        case kRusty:
            paint_rusty(p, q, s);
            break;
        case kMossy:
            paint_mossy(p, q, n, s);
            break;
        case kSnow:
            paint_snow(p, q, n, s);
            break;
        case kBurning:
            paint_burning(p, q, s);
            break;
        case kStriped:
        case kDotted:
            paint_pattern(p, q, n, s);
            break;
        default:
            paint_plain(p, q, s);
            break;
    }
    return s;
}

}  // namespace fieldgraft::generator
