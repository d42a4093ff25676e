#include "core/scene/camera_sampler.h"

#include <numbers>
#include <numeric>

#include "core/base/errors.h"

namespace fieldgraft {

namespace {

constexpr double pi = std::numbers::pi;

double uniform(Random& random, double low, double high) {
    return low + (high - low) * static_cast<double>(random.uniform());
}

Vec3 normal3(Random& random) {
    Vec3 v;
    for (double& value : v) value = static_cast<double>(random.normal());
    return v;
}

Vec3 in_ball(Random& random, double radius) {
    for (;;) {
        Vec3 v;
        for (double& value : v) value = uniform(random, -1, 1);
        if (dot(v, v) <= 1) return radius * v;
    }
}

Vec3 turned(const Vec3& v, const Vec3& axis, double angle) {  // Rodrigues' formula; axis of unit length
    const double c = std::cos(angle), s = std::sin(angle);
    return c * v + s * cross(axis, v) + ((1 - c) * dot(axis, v)) * axis;
}

// Axes between two poses': a straight mix, made orthonormal again. Fit for cameras that look about the same way.
Mat4 mixed_pose(const Mat4& a, const Mat4& b, double t) {
    const auto mix = [&](int j) { return (1 - t) * column(a, j) + t * column(b, j); };
    const Vec3 back = normalized(mix(2));
    const Vec3 up = mix(1);
    const Vec3 right = normalized(cross(up, back));
    return from_columns(right, cross(back, right), back, mix(3));
}

// The widest sector around `up` that no camera looks into, radians.
double widest_azimuth_gap(const std::vector<Camera>& cameras, const Vec3& up) {
    const Vec3 side = any_normal(up), ahead = cross(up, side);
    std::vector<double> angles;
    for (const Camera& camera : cameras)
        angles.push_back(std::atan2(dot(camera.forward(), ahead), dot(camera.forward(), side)));
    std::sort(angles.begin(), angles.end());
    double gap = angles.front() + 2 * pi - angles.back();
    for (std::size_t i = 1; i < angles.size(); ++i) gap = std::max(gap, angles[i] - angles[i - 1]);
    return gap;
}

void check(const HemisphereOptions& o) {
    if (!(o.radius_min > 0) || !(o.radius_max >= o.radius_min) || !std::isfinite(o.radius_max))
        throw std::invalid_argument(
            fmt::format("sample_hemisphere: radii {} … {}; 0 < min ≤ max is needed", o.radius_min, o.radius_max));
    if (!(o.focus_radius >= 0) || !(o.focus_radius < o.radius_min))
        throw std::invalid_argument(fmt::format("sample_hemisphere: focus radius {} must be in [0, radius_min {})",
                                                o.focus_radius, o.radius_min));
    if (!(o.elevation_min >= -90) || !(o.elevation_max <= 90) || !(o.elevation_min <= o.elevation_max))
        throw std::invalid_argument(fmt::format("sample_hemisphere: elevations {} … {}; −90 ≤ min ≤ max ≤ 90 is needed",
                                                o.elevation_min, o.elevation_max));
    if (!(length(o.up) > 0)) throw std::invalid_argument("sample_hemisphere: up is 0");
}

}  // namespace

Camera sample_hemisphere(const HemisphereOptions& options, Random& random) {
    check(options);
    const Vec3 up = normalized(options.up), side = any_normal(up), ahead = cross(up, side);
    // Equal areas of a sphere are equal steps of height (Archimedes).
    const double height =
        uniform(random, std::sin(options.elevation_min * pi / 180), std::sin(options.elevation_max * pi / 180));
    const double ring = std::sqrt(std::max(0.0, 1 - height * height)), azimuth = uniform(random, 0, 2 * pi);
    const double radius = uniform(random, options.radius_min, options.radius_max);
    const Vec3 direction = (ring * std::cos(azimuth)) * side + (ring * std::sin(azimuth)) * ahead + height * up;
    const Vec3 target = options.centre + in_ball(random, options.focus_radius);
    Camera camera = options.intrinsics;
    camera.camera_to_world = look_at(options.centre + radius * direction, target, up);
    return camera;
}

Camera sample_near_poses(const std::vector<Camera>& cameras, const NearPoseOptions& options, Random& random) {
    if (cameras.empty()) throw std::invalid_argument("sample_near_poses: no cameras");
    Camera camera = cameras[random.below(static_cast<std::uint32_t>(cameras.size()))];
    const Vec3 from = camera.position();
    const auto distance = [&](const Camera* other) { return length(other->position() - from); };
    // Others that look about the same way; between cameras that face each other there is no sensible middle.
    std::vector<const Camera*> others;
    for (const Camera& other : cameras)
        if (distance(&other) > 0 && dot(other.forward(), camera.forward()) > 0.5) others.push_back(&other);
    if (!others.empty()) {
        const auto count = std::min(others.size(), static_cast<std::size_t>(std::max(1, options.neighbours)));
        std::partial_sort(others.begin(), others.begin() + static_cast<std::ptrdiff_t>(count), others.end(),
                          [&](const Camera* a, const Camera* b) { return distance(a) < distance(b); });
        const Camera& other = *others[random.below(static_cast<std::uint32_t>(count))];
        camera.camera_to_world =
            mixed_pose(camera.camera_to_world, other.camera_to_world, static_cast<double>(random.uniform()));
        const Vec3 shift = (options.position_jitter * distance(&other) / std::sqrt(3.0)) * normal3(random);
        for (int i = 0; i < 3; ++i) camera.camera_to_world[4 * i + 3] += shift[i];
    }
    const Vec3 spin = (options.angle_jitter * pi / 180 / std::sqrt(3.0)) * normal3(random);
    const double angle = length(spin);
    if (angle > 0) {
        const Vec3 axis = (1 / angle) * spin;
        const Mat4& m = camera.camera_to_world;
        camera.camera_to_world = from_columns(turned(column(m, 0), axis, angle), turned(column(m, 1), axis, angle),
                                              turned(column(m, 2), axis, angle), column(m, 3));
    }
    return camera;
}

bool is_forward_facing(const std::vector<Camera>& cameras) {
    if (cameras.empty()) return false;
    Vec3 mean{0, 0, 0}, up{0, 0, 0};
    for (const Camera& camera : cameras) {
        mean = mean + camera.forward();
        up = up + column(camera.camera_to_world, 1);
    }
    if (length(mean) < 1e-9) return false;
    mean = normalized(mean);
    double narrowest = 1;
    for (const Camera& camera : cameras) narrowest = std::min(narrowest, dot(camera.forward(), mean));
    if (narrowest <= 0.5) return false;
    if (narrowest > std::cos(pi / 6) || length(up) < 1e-9) return true;
    return widest_azimuth_gap(cameras, normalized(up)) >= pi;
}

Vec3 focus_point(const std::vector<Camera>& cameras) {
    if (cameras.empty()) throw std::invalid_argument("focus_point: no cameras");
    // Σ(I − ddᵀ)(x − p) = 0: the point with the least sum of squared distances to the axes.
    const double share = 1.0 / static_cast<double>(cameras.size());
    std::array<Vec3, 3> a{};
    Vec3 b{0, 0, 0}, mean{0, 0, 0}, direction{0, 0, 0};
    for (const Camera& camera : cameras) {
        const Vec3 d = camera.forward(), p = camera.position();
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) a[i][j] += share * ((i == j ? 1 : 0) - d[i] * d[j]);
        b = b + share * (p - dot(d, p) * d);
        mean = mean + share * p;
        direction = direction + share * d;
    }
    // The matrix is symmetric, so its rows are its columns and Cramer's rule is three triple products.
    const double det = dot(a[0], cross(a[1], a[2]));
    const Vec3 focus = (1.0 / std::max(det, 1e-300)) *
                       Vec3{dot(b, cross(a[1], a[2])), dot(a[0], cross(b, a[2])), dot(a[0], cross(a[1], b))};
    const bool parallel = !(det > 1e-5), behind = is_forward_facing(cameras) && dot(focus - mean, direction) <= 0;
    if (!parallel && !behind) return focus;
    double spread = 0;
    for (const Camera& camera : cameras) spread = std::max(spread, length(camera.position() - mean));
    return mean + (spread > 0 ? spread : 1.0) * normalized(direction);
}

}  // namespace fieldgraft
