// Small fixed-size vectors, a 3x3 matrix and bit-exact elementary functions for the picture generator.
// Frame: right-handed, z up; lengths in object units (an object is about 2 across). Matrices are stored by columns.
// sine/cosine/exponential are polynomials of our own (absolute error below 2e-4): libm's results differ between
// versions, and a picture must have the same bytes everywhere. sqrt is exact by IEEE 754, so it is used as it is.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace fieldgraft::generator {

constexpr float kPi = 3.14159265f;

struct Vec3 {
    float x = 0.0f, y = 0.0f, z = 0.0f;
    float operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
};

inline Vec3 operator+(Vec3 a, Vec3 b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Vec3 operator-(Vec3 a, Vec3 b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Vec3 operator*(Vec3 a, Vec3 b) {
    return {a.x * b.x, a.y * b.y, a.z * b.z};
}
inline Vec3 operator*(Vec3 a, float s) {
    return {a.x * s, a.y * s, a.z * s};
}
inline Vec3 operator*(float s, Vec3 a) {
    return a * s;
}
inline Vec3 operator-(Vec3 a) {
    return {-a.x, -a.y, -a.z};
}
inline float dot(Vec3 a, Vec3 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline Vec3 cross(Vec3 a, Vec3 b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline float length(Vec3 a) {
    return std::sqrt(dot(a, a));
}
inline Vec3 normalized(Vec3 a) {
    return a * (1.0f / std::max(length(a), 1e-12f));
}
inline Vec3 minimum(Vec3 a, Vec3 b) {
    return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)};
}
inline Vec3 maximum(Vec3 a, Vec3 b) {
    return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)};
}
inline Vec3 absolute(Vec3 a) {
    return {std::fabs(a.x), std::fabs(a.y), std::fabs(a.z)};
}
inline Vec3 mix(Vec3 a, Vec3 b, float t) {
    return a + (b - a) * t;
}
inline float mix(float a, float b, float t) {
    return a + (b - a) * t;
}
inline float clamp01(float x) {
    return std::min(std::max(x, 0.0f), 1.0f);
}
inline float smoothstep(float lo, float hi, float x) {
    const float t = clamp01((x - lo) / (hi - lo));
    return t * t * (3.0f - 2.0f * t);
}

// sin(x), reduced to [-pi/2, pi/2] and a degree-7 polynomial.
inline float sine(float x) {
    const float turns = x * (1.0f / (2.0f * kPi));
    float f = turns - std::floor(turns + 0.5f);  // [-0.5, 0.5)
    if (f > 0.25f) f = 0.5f - f;
    if (f < -0.25f) f = -0.5f - f;
    const float a = f * (2.0f * kPi), b = a * a;
    return a * (1.0f + b * (-0.16666667f + b * (0.0083333310f - b * 0.00019840874f)));
}
inline float cosine(float x) {
    return sine(x + 0.5f * kPi);
}

// x^(2^n): the sharpness of highlights without pow().
inline float power_of_two(float x, int n) {
    for (int i = 0; i < n; ++i) x *= x;
    return x;
}

// Columns a, b, c.
struct Mat3 {
    Vec3 a{1, 0, 0}, b{0, 1, 0}, c{0, 0, 1};
};
inline Vec3 operator*(const Mat3& m, Vec3 v) {
    return m.a * v.x + m.b * v.y + m.c * v.z;
}
inline Vec3 transposed_times(const Mat3& m, Vec3 v) {
    return {dot(m.a, v), dot(m.b, v), dot(m.c, v)};
}
inline Mat3 operator*(const Mat3& m, const Mat3& n) {
    return {m * n.a, m * n.b, m * n.c};
}

inline Mat3 rotation_z(float t) {
    return {{cosine(t), sine(t), 0}, {-sine(t), cosine(t), 0}, {0, 0, 1}};
}
inline Mat3 rotation_y(float t) {
    return {{cosine(t), 0, -sine(t)}, {0, 1, 0}, {sine(t), 0, cosine(t)}};
}
inline Mat3 rotation_x(float t) {
    return {{1, 0, 0}, {0, cosine(t), sine(t)}, {0, -sine(t), cosine(t)}};
}

// A rotation whose third column is the given unit direction.
inline Mat3 frame_along(Vec3 w) {
    const Vec3 helper = std::fabs(w.z) < 0.9f ? Vec3{0, 0, 1} : Vec3{1, 0, 0};
    const Vec3 u = normalized(cross(helper, w));
    return {u, cross(w, u), w};
}

}  // namespace fieldgraft::generator
