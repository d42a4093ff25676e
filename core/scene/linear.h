// Three-dimensional vectors and row-major matrices in double, as little of them as cameras need.
//
//   Vec3  x y z.  Mat4  4×4 row-major, acts on columns; a pose is a camera-to-world matrix whose columns are the
//   camera's right, up and backward axes and its position (OpenGL axes: the camera looks along −Z, +Y is up).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

namespace fieldgraft {

using Vec3 = std::array<double, 3>;
using Mat4 = std::array<double, 16>;

constexpr Mat4 identity4{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

constexpr Vec3 operator+(const Vec3& a, const Vec3& b) {
    return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
constexpr Vec3 operator-(const Vec3& a, const Vec3& b) {
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
constexpr Vec3 operator*(double s, const Vec3& a) {
    return {s * a[0], s * a[1], s * a[2]};
}
constexpr double dot(const Vec3& a, const Vec3& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
constexpr Vec3 cross(const Vec3& a, const Vec3& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline double length(const Vec3& a) {
    return std::sqrt(dot(a, a));
}
// Of unit length; a must not be 0.
inline Vec3 normalized(const Vec3& a) {
    return (1.0 / length(a)) * a;
}

constexpr Vec3 column(const Mat4& m, int j) {
    return {m[j], m[4 + j], m[8 + j]};
}
constexpr Vec3 position_of(const Mat4& pose) {
    return column(pose, 3);
}
// The direction a camera looks along.
constexpr Vec3 forward_of(const Mat4& pose) {
    return -1.0 * column(pose, 2);
}
constexpr Mat4 from_columns(const Vec3& x, const Vec3& y, const Vec3& z, const Vec3& t) {
    return {x[0], y[0], z[0], t[0], x[1], y[1], z[1], t[1], x[2], y[2], z[2], t[2], 0, 0, 0, 1};
}

// Some unit vector at a right angle to the unit vector a.
inline Vec3 any_normal(const Vec3& a) {
    const Vec3 other = std::abs(a[0]) < 0.6 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
    return normalized(cross(a, other));
}

// The pose of a camera at `eye` that looks at `target`, its right axis level with respect to `up`. Looking straight
// along `up` leaves the roll open: some right axis is taken. eye ≠ target.
inline Mat4 look_at(const Vec3& eye, const Vec3& target, const Vec3& up) {
    const Vec3 back = normalized(eye - target);
    const Vec3 side = cross(up, back);
    const Vec3 right = length(side) > 1e-9 * length(up) ? normalized(side) : any_normal(back);
    return from_columns(right, cross(back, right), back, eye);
}

}  // namespace fieldgraft
