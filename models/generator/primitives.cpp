#include "models/generator/primitives.h"

namespace fieldgraft::generator {
namespace {

bool hit_sphere(Vec3 o, Vec3 d, float t_min, Hit& hit) {
    const float a = dot(d, d), b = dot(o, d), c = dot(o, o) - 1.0f;
    const float disc = b * b - a * c;
    if (disc < 0.0f) return false;
    const float t = (-b - std::sqrt(disc)) / a;
    if (t <= t_min) return false;
    hit = {t, o + d * t};
    return true;
}

bool hit_dome(Vec3 o, Vec3 d, float t_min, Hit& hit) {
    const float a = dot(d, d), b = dot(o, d), c = dot(o, o) - 1.0f;
    const float disc = b * b - a * c;
    if (disc < 0.0f) return false;
    const float root = std::sqrt(disc);
    const float t = (-b - root) / a;
    if (t > t_min && o.z + t * d.z >= 0.0f) {
        hit = {t, o + d * t};
        return true;
    }
    // The flat side.
    const float s = d.z != 0.0f ? -o.z / d.z : -1.0f;
    const Vec3 p = o + d * s;
    if (s <= t_min || p.x * p.x + p.y * p.y > 1.0f) return false;
    hit = {s, {0, 0, -1}};
    return true;
}

bool hit_box(Vec3 o, Vec3 d, float t_min, Hit& hit) {
    const float ix = 1.0f / d.x, iy = 1.0f / d.y, iz = 1.0f / d.z;
    const float nx = -o.x * ix - std::fabs(ix), fx = -o.x * ix + std::fabs(ix);
    const float ny = -o.y * iy - std::fabs(iy), fy = -o.y * iy + std::fabs(iy);
    const float nz = -o.z * iz - std::fabs(iz), fz = -o.z * iz + std::fabs(iz);
    const float t = std::max(nx, std::max(ny, nz));
    if (t > std::min(fx, std::min(fy, fz)) || t <= t_min) return false;
    hit.t = t;
    if (t == nx)
        hit.normal = {d.x < 0.0f ? 1.0f : -1.0f, 0, 0};
    else if (t == ny)
        hit.normal = {0, d.y < 0.0f ? 1.0f : -1.0f, 0};
    else
        hit.normal = {0, 0, d.z < 0.0f ? 1.0f : -1.0f};
    return true;
}

// x^2 + y^2 = (m + q z)^2 between the lids.
bool hit_frustum(const Primitive& p, Vec3 o, Vec3 d, float t_min, Hit& hit) {
    const float m = 0.5f * (1.0f + p.shape), q = 0.5f * (p.shape - 1.0f);
    const float radius = m + q * o.z;
    const float a = d.x * d.x + d.y * d.y - q * q * d.z * d.z;
    const float b = o.x * d.x + o.y * d.y - q * d.z * radius;
    const float c = o.x * o.x + o.y * o.y - radius * radius;
    float best = 1e30f;
    const float disc = b * b - a * c;
    if (disc >= 0.0f && a != 0.0f) {
        const float root = std::sqrt(disc), inv = 1.0f / a;
        for (const float t : {(-b - root) * inv, (-b + root) * inv}) {
            const float z = o.z + t * d.z;
            if (t > t_min && t < best && z >= -1.0f && z <= 1.0f && m + q * z >= 0.0f) {
                best = t;
                hit = {t, {o.x + t * d.x, o.y + t * d.y, -q * (m + q * z)}};
            }
        }
    }
    if (d.z != 0.0f) {
        for (const float lid : {-1.0f, 1.0f}) {
            if (lid > 0.0f && (p.open || p.shape <= 0.0f)) continue;
            const float t = (lid - o.z) / d.z;
            const float x = o.x + t * d.x, y = o.y + t * d.y, r = m + q * lid;
            if (t > t_min && t < best && x * x + y * y <= r * r) {
                best = t;
                hit = {t, {0, 0, lid}};
            }
        }
    }
    if (best > 1e29f) return false;
    if (dot(hit.normal, d) > 0.0f) hit.normal = -hit.normal;  // seen from inside an open one
    return true;
}

float torus_distance(Vec3 p, float minor) {
    const float ring = std::sqrt(p.x * p.x + p.y * p.y) - 1.0f;
    return std::sqrt(ring * ring + p.z * p.z) - minor;
}

bool hit_torus(const Primitive& p, Vec3 o, Vec3 d, float t_min, Hit& hit) {
    const float outer = 1.0f + p.shape, speed = length(d);
    const float a = dot(d, d), b = dot(o, d), c = dot(o, o) - outer * outer;
    const float disc = b * b - a * c;
    if (disc < 0.0f) return false;
    const float root = std::sqrt(disc);
    float t = std::max((-b - root) / a, t_min), end = (-b + root) / a;
    if (d.z != 0.0f) {  // the slab |z| <= minor radius
        const float near = (-o.z - std::copysign(p.shape, d.z)) / d.z, far = (-o.z + std::copysign(p.shape, d.z)) / d.z;
        t = std::max(t, near);
        end = std::min(end, far);
    }
    for (int step = 0; step < 32 && t < end; ++step) {
        const Vec3 q = o + d * t;
        const float distance = torus_distance(q, p.shape);
        if (distance < 2e-3f) {
            const float ring = std::max(std::sqrt(q.x * q.x + q.y * q.y), 1e-6f);
            hit = {t, {q.x - q.x / ring, q.y - q.y / ring, q.z}};
            return true;
        }
        t += distance / speed;
    }
    return false;
}

struct HalfSpace {
    Vec3 n;
    float offset;
};

template <int kCount>
bool hit_planes(const HalfSpace (&planes)[kCount], Vec3 o, Vec3 d, float t_min, Hit& hit) {
    float enter = -1e30f, leave = 1e30f;
    for (const HalfSpace& s : planes) {
        const float rate = dot(s.n, d), gap = s.offset - dot(s.n, o);
        if (rate == 0.0f) {
            if (gap < 0.0f) return false;
            continue;
        }
        const float t = gap / rate;
        if (rate < 0.0f) {
            if (t > enter) {
                enter = t;
                hit.normal = s.n;
            }
        } else {
            leave = std::min(leave, t);
        }
        if (enter > leave) return false;
    }
    hit.t = enter;
    return enter > t_min;
}

bool hit_plane(Vec3 o, Vec3 d, float t_min, Hit& hit) {
    const float t = d.z < 0.0f ? -o.z / d.z : -1.0f;
    hit = {t, {0, 0, 1}};
    return t > t_min && t < 60.0f;
}

constexpr HalfSpace kWedgePlanes[] = {
    {{-1, 0, 0}, 1}, {{0, 1, 0}, 1}, {{0, -1, 0}, 1}, {{0, 0, -1}, 1}, {{1, 0, 1}, 0}};
constexpr HalfSpace kGablePlanes[] = {
    {{2, 0, 1}, 1}, {{-2, 0, 1}, 1}, {{0, 1, 0}, 1}, {{0, -1, 0}, 1}, {{0, 0, -1}, 1}};
constexpr HalfSpace kPyramidPlanes[] = {
    {{2, 0, 1}, 1}, {{-2, 0, 1}, 1}, {{0, 2, 1}, 1}, {{0, -2, 1}, 1}, {{0, 0, -1}, 1}};

// Calls visit with the hit function of the primitive's solid, so that loops are compiled once a solid.
template <typename Visit>
auto with_solid(const Primitive& p, const Visit& visit) {
    switch (p.solid) {
        case Solid::kSphere:
            return visit([](Vec3 o, Vec3 d, float t, Hit& h) { return hit_sphere(o, d, t, h); });
        case Solid::kDome:
            return visit([](Vec3 o, Vec3 d, float t, Hit& h) { return hit_dome(o, d, t, h); });
        case Solid::kFrustum:
            return visit([&p](Vec3 o, Vec3 d, float t, Hit& h) { return hit_frustum(p, o, d, t, h); });
        case Solid::kTorus:
            return visit([&p](Vec3 o, Vec3 d, float t, Hit& h) { return hit_torus(p, o, d, t, h); });
        case Solid::kWedge:
            return visit([](Vec3 o, Vec3 d, float t, Hit& h) { return hit_planes(kWedgePlanes, o, d, t, h); });
        case Solid::kGable:
            return visit([](Vec3 o, Vec3 d, float t, Hit& h) { return hit_planes(kGablePlanes, o, d, t, h); });
        case Solid::kPyramid:
            return visit([](Vec3 o, Vec3 d, float t, Hit& h) { return hit_planes(kPyramidPlanes, o, d, t, h); });
        case Solid::kPlane:
            return visit([](Vec3 o, Vec3 d, float t, Hit& h) { return hit_plane(o, d, t, h); });
        case Solid::kBox:
            break;
    }
    return visit([](Vec3 o, Vec3 d, float t, Hit& h) { return hit_box(o, d, t, h); });
}

}  // namespace

bool intersect(const Primitive& p, Vec3 o, Vec3 d, float t_min, Hit& hit) {
    return with_solid(p, [&](const auto& solid) { return solid(o, d, t_min, hit); });
}

void intersect_row(const Primitive& p, const RayRow& ray, int x0, int x1, float t_min, const float* limit, float* depth,
                   int16_t* id, int16_t index) {
    with_solid(p, [&](const auto& solid) {
        Hit hit;
        for (int x = x0; x < x1; ++x) {
            const auto fx = static_cast<float>(x);
            if (!solid(ray.o + ray.ou * fx, ray.d + ray.du * fx, t_min, hit)) continue;
            if (hit.t < depth[x] && (!limit || hit.t < limit[x])) {
                depth[x] = hit.t;
                id[x] = index;
            }
        }
    });
}

Vec3 local_bound(const Primitive& p) {
    if (p.solid == Solid::kTorus) return {1.0f + p.shape, 1.0f + p.shape, p.shape};
    if (p.solid == Solid::kFrustum) {
        const float r = std::max(1.0f, p.shape);
        return {r, r, 1.0f};
    }
    return {1, 1, 1};
}

Vec3 world_bound(const Primitive& p) {
    const Vec3 b = local_bound(p) * p.half;
    return absolute(p.rotation.a) * b.x + absolute(p.rotation.b) * b.y + absolute(p.rotation.c) * b.z;
}

}  // namespace fieldgraft::generator
