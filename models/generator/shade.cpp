#include "models/generator/shade.h"

namespace fieldgraft::generator {
namespace {

constexpr int kShadowSize = 56;

// What a mirror sees: sky above, ground below, a dark horizon line and two soft boxes.
Vec3 surrounding(const View& v, Vec3 d) {
    const Vec3 ground = v.horizon * 0.55f + Vec3{0.04f, 0.04f, 0.04f};
    Vec3 c = d.z > 0 ? mix(v.horizon, v.sky, smoothstep(0.0f, 0.75f, d.z))
                     : mix(v.horizon, ground * 1.6f, smoothstep(0.0f, 0.5f, -d.z));
    c = c + Vec3{1.6f, 1.6f, 1.6f} * smoothstep(0.80f, 0.92f, dot(d, v.key_direction));
    c = c + Vec3{0.8f, 0.8f, 0.8f} * smoothstep(0.82f, 0.95f, dot(d, v.fill_direction));
    return c;
}

// Studs or panel lines on a box or a mesh on a ball: changes the normal and darkens the joints.
void apply_pattern(const Primitive& p, Vec3 local, Vec3 local_normal, Surface& s, Vec3& bump) {
    const Vec3 q = local * p.half, a = absolute(local_normal);
    const bool top = a.z >= a.x && a.z >= a.y;
    const float u = (top ? q.x : a.x >= a.y ? q.y : q.x) / p.pattern, v = (top ? q.y : q.z) / p.pattern;
    const float du = u - std::floor(u) - 0.5f, dv = v - std::floor(v) - 0.5f;
    if (top && p.solid == Solid::kBox) {  // studs
        const float r2 = du * du + dv * dv;
        if (r2 > 0.09f && r2 < 0.19f) bump = p.rotation * (Vec3{du, dv, 0} * 1.6f);
        if (r2 >= 0.19f) s.albedo = s.albedo * 0.82f;
    } else if (std::fabs(du) > 0.38f || std::fabs(dv) > 0.38f) {
        s.albedo = s.albedo * 0.55f;
    }
}

}  // namespace

ShadowMap::ShadowMap(const World& world, const View& view)
    : axes_(frame_along(view.key_direction)), buffer_(kShadowSize) {
    centre_ = (world.low + world.high) * 0.5f;
    reach_ = 0.75f * length(world.high - world.low);
    const float step = 2.0f * reach_ / kShadowSize;
    RayGrid g;
    g.n = kShadowSize;
    g.ou = axes_.a * step;
    g.ov = axes_.b * step;
    g.o = centre_ + axes_.c * (2 * reach_) - (axes_.a + axes_.b) * (reach_ - 0.5f * step);
    g.d = -axes_.c;
    const auto project = [&](Vec3 at, float& x, float& y) {
        texel(at, x, y);
        return true;
    };
    for (size_t i = 0; i < world.primitives.size(); ++i) {
        const Primitive& p = world.primitives[i];
        if (p.layer != Layer::kOpaque || p.solid == Solid::kPlane ||
            world.objects[static_cast<size_t>(p.object)].ground)
            continue;
        cast(p, static_cast<int16_t>(i), g, cover(p, kShadowSize, project), nullptr, buffer_);
    }
}

float ShadowMap::lit(Vec3 at, Vec3 normal) const {
    const Vec3 p = at + normal * 0.04f;
    float x, y;
    texel(p, x, y);
    const float depth = 2 * reach_ - dot(axes_.c, p - centre_) - 0.05f;
    const float fx = std::floor(x), fy = std::floor(y);
    const int ix = static_cast<int>(fx), iy = static_cast<int>(fy);
    if (ix < 0 || iy < 0 || ix + 1 >= kShadowSize || iy + 1 >= kShadowSize) return 1.0f;
    const auto tap = [&](int dx, int dy) {
        return buffer_.depth[static_cast<size_t>((iy + dy) * kShadowSize + ix + dx)] < depth ? 0.0f : 1.0f;
    };
    return mix(mix(tap(0, 0), tap(1, 0), x - fx), mix(tap(0, 1), tap(1, 1), x - fx), y - fy);
}

void ShadowMap::texel(Vec3 at, float& x, float& y) const {
    const Vec3 p = at - centre_;
    const float per = 0.5f * kShadowSize / reach_;
    x = (dot(axes_.a, p) + reach_) * per - 0.5f;
    y = (dot(axes_.b, p) + reach_) * per - 0.5f;
}

Shader::Shader(const World& world, const View& view)
    : world_(world), view_(view), centre_((world.low + world.high) * 0.5f) {
    if (view.shadows) shadow_.emplace(world, view);
}

Shading Shader::shade(const Primitive& p, Vec3 d) const {
    Hit hit;
    const Vec3 o = to_local(p, view_.eye - p.centre), local_d = to_local(p, d);
    if (!intersect(p, o, local_d, 0.02f, hit)) return {};
    const Vec3 at = view_.eye + d * hit.t, local = o + local_d * hit.t;
    Vec3 n = normal_to_world(p, hit.normal);
    const WorldObject& object = world_.objects[static_cast<size_t>(p.object)];
    const Vec3 q = transposed_times(object.rotation, at - object.position) * (1.0f / object.size);
    const bool cover = world_.paints[static_cast<size_t>(p.paint)].material == kSnow;  // falls from the world's sky
    Surface s =
        surface_at(world_.paints[static_cast<size_t>(p.paint)], q, cover ? n : transposed_times(object.rotation, n));
    Vec3 bump = object.rotation * s.bump;
    if (p.pattern > 0.0f) apply_pattern(p, local, hit.normal, s, bump);
    n = normalized(n + bump);
    return {light(s, p.shade, at, n, normalized(-d), object.ground), s.snow};
}

Vec3 Shader::light(const Surface& s, float tone, Vec3 at, Vec3 n, Vec3 eye, bool ground) const {
    const float facing = dot(n, view_.key_direction);
    const float lit = !shadow_ || facing <= 0.0f ? 1.0f : shadow_->lit(at, n);
    const float near_ground = ground ? 1.0f : mix(0.72f, 1.0f, smoothstep(0.0f, 0.5f, at.z + 0.3f * n.z));
    const Vec3 diffuse = view_.key * (std::max(facing, 0.0f) * lit) +
                         view_.fill * std::max(dot(n, view_.fill_direction), 0.0f) +
                         view_.ambient * ((0.72f + 0.28f * n.z) * near_ground);
    const float grazing = 1.0f - clamp01(dot(n, eye));
    const float fresnel = grazing * grazing * grazing * grazing * grazing;
    const Vec3 mirror = n * (2.0f * dot(n, eye)) - eye;
    // Near surroundings: the reflection also moves along a flat face.
    const Vec3 seen = surrounding(view_, s.metal > 0.0f ? normalized(mirror + (at - centre_) * 0.4f) : mirror);
    if (s.metal > 0.0f) {
        const Vec3 f = mix(s.albedo, {1, 1, 1}, fresnel * 0.7f);
        return (seen * f * 0.95f + s.albedo * diffuse * 0.16f) * tone + s.emission;
    }
    const float highlight = power_of_two(clamp01(dot(mirror, view_.key_direction)), s.sharpness) * lit;
    return s.albedo * diffuse * tone + seen * (0.35f * fresnel * s.specular * 8.0f) +
           view_.key * (highlight * s.specular * 7.0f) + s.emission;
}

Vec3 Shader::glass_over(const Primitive& p, Vec3 n, Vec3 eye, Vec3 through) const {
    const Paint& paint = world_.paints[static_cast<size_t>(p.paint)];
    const float grazing = 1.0f - clamp01(dot(n, eye));
    const Vec3 tint = paint.colour >= 0 ? mix({1, 1, 1}, paint.base, 0.72f) : Vec3{0.80f, 0.88f, 0.87f};
    const Vec3 mirror = n * (2.0f * dot(n, eye)) - eye;
    const float fresnel = 0.06f + 0.5f * grazing * grazing * grazing;
    const float rim = 1.0f - 0.62f * smoothstep(0.45f, 0.95f, grazing);
    const float spark = power_of_two(clamp01(dot(mirror, view_.key_direction)), 6);
    return through * tint * (rim * 0.94f) * mix(1.0f, p.shade, 0.5f) + surrounding(view_, mirror) * (fresnel * 0.75f) +
           Vec3{1, 1, 1} * (1.3f * spark);
}

Flame flame_at(const View& view, const Primitive& p, Vec3 d, float limit) {
    Hit hit;
    const Vec3 o = to_local(p, view.eye - p.centre), local_d = to_local(p, d);
    if (!intersect(p, o, local_d, 0.02f, hit) || hit.t > limit) return {};
    const Vec3 local = o + local_d * hit.t;
    const float facing = std::fabs(dot(normal_to_world(p, hit.normal), normalized(d)));
    const float lick = noise((local * Vec3{1.6f, 1.6f, 1.1f}) * 1.7f + Vec3{p.shade * 40.0f, 0, 3});
    // Pointed above, round below.
    const float body = facing * (1.0f - 0.55f * clamp01(local.z)) + 0.5f * (lick - 0.5f);
    const float heat = clamp01(0.85f * body + 0.25f - 0.45f * local.z);
    const Vec3 cool{0.85f, 0.10f, 0.005f}, warm{1.0f, 0.36f, 0.02f}, hot{1.0f, 0.86f, 0.32f};
    const Vec3 colour = heat < 0.5f ? mix(cool, warm, heat * 2.0f) : mix(warm, hot, heat * 2.0f - 1.0f);
    return {colour, smoothstep(0.18f, 0.55f, body) * 0.92f};
}

}  // namespace fieldgraft::generator
