#include "models/generator/render.h"

#include <array>

#include "models/generator/surface.h"

namespace fieldgraft::generator {
namespace {

constexpr int kShadowSize = 56;

// Rays o + u ou + v ov, d + u du + v dv over a square grid of n x n samples (u right, v down).
struct RayGrid {
    Vec3 o, ou, ov, d, du, dv;
    int n = 0;
};

struct DepthBuffer {
    std::vector<float> depth;
    std::vector<int16_t> id;
    explicit DepthBuffer(int n) : depth(static_cast<size_t>(n * n), 1e30f), id(static_cast<size_t>(n * n), -1) {}
};

struct Rect {
    int x0, x1, y0, y1;
};

// Sample rectangle that covers the primitive; the perspective grid has du, dv orthogonal to d at its middle.
template <typename Project>
Rect cover(const Primitive& p, int n, const Project& project) {
    if (p.solid == Solid::kPlane) return {0, n, 0, n};
    const Vec3 b = local_bound(p) * p.half;
    float x0 = 1e9f, x1 = -1e9f, y0 = 1e9f, y1 = -1e9f;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3 at =
            p.centre + p.rotation * Vec3{corner & 1 ? b.x : -b.x, corner & 2 ? b.y : -b.y, corner & 4 ? b.z : -b.z};
        float x, y;
        if (!project(at, x, y)) return {0, n, 0, n};
        x0 = std::min(x0, x);
        x1 = std::max(x1, x);
        y0 = std::min(y0, y);
        y1 = std::max(y1, y);
    }
    const auto clip = [n](float x) { return static_cast<int>(std::min(std::max(x, 0.0f), static_cast<float>(n))); };
    return {clip(std::floor(x0)), clip(std::ceil(x1) + 1.0f), clip(std::floor(y0)), clip(std::ceil(y1) + 1.0f)};
}

void cast(const Primitive& p, int16_t index, const RayGrid& g, const Rect& r, const float* limit, DepthBuffer& buffer) {
    const Vec3 o0 = to_local(p, g.o - p.centre), ou = to_local(p, g.ou), ov = to_local(p, g.ov);
    const Vec3 d0 = to_local(p, g.d), du = to_local(p, g.du), dv = to_local(p, g.dv);
    for (int y = r.y0; y < r.y1; ++y) {
        const auto fy = static_cast<float>(y);
        const auto row = static_cast<size_t>(y * g.n);
        intersect_row(p, {o0 + ov * fy, ou, d0 + dv * fy, du}, r.x0, r.x1, 0.02f, limit ? limit + row : nullptr,
                      &buffer.depth[row], &buffer.id[row], index);
    }
}

RayGrid camera_rays(const View& v, int n) {
    RayGrid g;
    g.n = n;
    g.o = v.eye;
    const float step = 2.0f * v.tangent / static_cast<float>(n);
    g.du = v.axes.a * step;
    g.dv = v.axes.b * -step;
    g.d = v.axes.c + v.axes.a * (v.tangent * (-1.0f - v.shift_x) + 0.5f * step) +
          v.axes.b * (v.tangent * (1.0f + v.shift_y) - 0.5f * step);
    return g;
}

bool camera_project(const View& v, int n, Vec3 at, float& x, float& y) {
    const Vec3 p = transposed_times(v.axes, at - v.eye);
    if (p.z < 0.05f) return false;
    const float half = 0.5f * static_cast<float>(n);
    x = (p.x / (p.z * v.tangent) + 1.0f + v.shift_x) * half - 0.5f;
    y = (1.0f + v.shift_y - p.y / (p.z * v.tangent)) * half - 0.5f;
    return true;
}

class ShadowMap {
  public:
    ShadowMap(const World& world, const View& view) : axes_(frame_along(view.key_direction)), buffer_(kShadowSize) {
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

    // 1 lit, 0 in shadow; four taps with bilinear weights.
    float lit(Vec3 at, Vec3 normal) const {
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

  private:
    void texel(Vec3 at, float& x, float& y) const {
        const Vec3 p = at - centre_;
        const float per = 0.5f * kShadowSize / reach_;
        x = (dot(axes_.a, p) + reach_) * per - 0.5f;
        y = (dot(axes_.b, p) + reach_) * per - 0.5f;
    }

    Mat3 axes_;
    Vec3 centre_;
    float reach_ = 1.0f;
    DepthBuffer buffer_;
};

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

struct Shading {
    Vec3 colour;
    float snow = 0.0f;
};

class Shader {
  public:
    Shader(const World& world, const View& view)
        : world_(world), view_(view), centre_((world.low + world.high) * 0.5f) {
        if (view.shadows) shadow_.emplace_back(world, view);
    }

    // Colour of the primitive where the ray meets it; false if it just misses (an edge sample moved to the centre).
    bool shade(const Primitive& p, Vec3 d, Shading& out) const {
        Hit hit;
        const Vec3 o = to_local(p, view_.eye - p.centre), local_d = to_local(p, d);
        if (!intersect(p, o, local_d, 0.02f, hit)) return false;
        const Vec3 at = view_.eye + d * hit.t, local = o + local_d * hit.t;
        Vec3 n = normal_to_world(p, hit.normal);
        const WorldObject& object = world_.objects[static_cast<size_t>(p.object)];
        const Vec3 q = transposed_times(object.rotation, at - object.position) * (1.0f / object.size);
        const bool cover = world_.paints[static_cast<size_t>(p.paint)].material == kSnow;  // falls from the world's sky
        Surface s = surface_at(world_.paints[static_cast<size_t>(p.paint)], q,
                               cover ? n : transposed_times(object.rotation, n));
        Vec3 bump = object.rotation * s.bump;
        if (p.pattern > 0.0f) apply_pattern(p, local, hit.normal, s, bump);
        n = normalized(n + bump);
        out.colour = light(s, p.shade, at, n, normalized(-d), object.ground);
        out.snow = s.snow;
        return true;
    }

  private:
    Vec3 light(const Surface& s, float tone, Vec3 at, Vec3 n, Vec3 eye, bool ground) const {
        const float facing = dot(n, view_.key_direction);
        const float lit = shadow_.empty() || facing <= 0.0f ? 1.0f : shadow_[0].lit(at, n);
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

    const World& world_;
    const View& view_;
    Vec3 centre_;
    std::vector<ShadowMap> shadow_;
};

Vec3 backdrop_at(const BackdropSpec& b, const Paint& paint, const Paint& other, float u, float v) {
    switch (b.kind) {
        case BackdropKind::kWhite:
            return {1, 1, 1};
        case BackdropKind::kColour:
            return paint.base;
        case BackdropKind::kGradient:
            return mix(paint.base, other.base, v);
        case BackdropKind::kNoise:
            return mix(paint.base, other.base, noise2(Vec3{u * 5, v * 5, 0} + paint.offset));
    }
    return {1, 1, 1};
}

// The picture while it is made: linear colour a pixel.
class Painter {
  public:
    Painter(const World& world, const View& view, const BackdropSpec& backdrop, int size)
        : world_(world),
          view_(view),
          size_(size),
          n_(2 * size),
          shader_(world, view),
          opaque_(n_),
          colour_(static_cast<size_t>(size * size)),
          snow_(static_cast<size_t>(size * size), 0.0f) {
        grid_ = camera_rays(view, n_);
        Rng rng = Rng(backdrop.seed).fork(41);
        Rng tint = rng.fork(1), tint2 = rng.fork(2);
        const Vec3 a = sample_colour(backdrop.colour >= 0 ? backdrop.colour : rng.below(kColours), 0, tint);
        const Vec3 b = sample_colour(rng.below(kColours), 0, tint2);
        // Unnamed backdrops are muted.
        const Vec3 grey{0.6f, 0.6f, 0.62f};
        first_.base = backdrop.colour >= 0 ? a * a : mix(grey, a * a, 0.45f);
        second_.base = mix(grey, b * b, 0.45f);
        first_.offset = {rng.uniform(0, 50), rng.uniform(0, 50), rng.uniform(0, 50)};
        backdrop_ = backdrop;
    }

    void opaque() {
        cast_layer(Layer::kOpaque, nullptr, opaque_);
        std::array<Vec3, 4> shaded;
        for (int y = 0; y < size_; ++y) {
            for (int x = 0; x < size_; ++x) {
                const auto first = static_cast<size_t>(2 * y * n_ + 2 * x);
                if (std::max(std::max(opaque_.id[first], opaque_.id[first + 1]),
                             std::max(opaque_.id[first + static_cast<size_t>(n_)],
                                      opaque_.id[first + static_cast<size_t>(n_) + 1])) < 0) {
                    colour_[static_cast<size_t>(y * size_ + x)] = backdrop(x, y);
                    continue;
                }
                Vec3 sum;
                float snow = 0.0f;
                for (int k = 0; k < 4; ++k) {
                    const int sx = 2 * x + (k & 1), sy = 2 * y + (k >> 1);
                    const int16_t id = opaque_.id[static_cast<size_t>(sy * n_ + sx)];
                    // The same primitive was shaded at an earlier sample of this pixel.
                    int twin = -1;
                    for (int j = 0; j < k; ++j) {
                        if (opaque_.id[static_cast<size_t>((2 * y + (j >> 1)) * n_ + 2 * x + (j & 1))] == id) twin = j;
                    }
                    if (twin >= 0) {
                        shaded[static_cast<size_t>(k)] = shaded[static_cast<size_t>(twin)];
                    } else if (id < 0) {
                        shaded[static_cast<size_t>(k)] = backdrop(x, y);
                    } else {
                        Shading s;
                        shader_.shade(world_.primitives[static_cast<size_t>(id)], ray(sx, sy), s);
                        shaded[static_cast<size_t>(k)] = fade(s.colour, id, sx, sy, x, y);
                        snow = std::max(snow, s.snow);
                    }
                    sum = sum + shaded[static_cast<size_t>(k)];
                }
                colour_[static_cast<size_t>(y * size_ + x)] = sum * 0.25f;
                snow_[static_cast<size_t>(y * size_ + x)] = snow;
            }
        }
    }

    void glass() {
        if (!has(Layer::kGlass)) return;
        DepthBuffer front(n_);
        cast_layer(Layer::kGlass, opaque_.depth.data(), front);
        const std::vector<Vec3> behind = colour_;
        for (int y = 0; y < size_; ++y) {
            for (int x = 0; x < size_; ++x) {
                int covered = 0, first = -1;
                for (int k = 0; k < 4; ++k) {
                    const auto at = static_cast<size_t>((2 * y + (k >> 1)) * n_ + 2 * x + (k & 1));
                    if (front.id[at] < 0) continue;
                    opaque_.id[at] = front.id[at];
                    opaque_.depth[at] = front.depth[at];
                    ++covered;
                    if (first < 0) first = k;
                }
                if (covered == 0) continue;
                const auto at = static_cast<size_t>((2 * y + (first >> 1)) * n_ + 2 * x + (first & 1));
                const Vec3 c = glass_colour(front.id[at], 2 * x + (first & 1), 2 * y + (first >> 1), behind);
                Vec3& out = colour_[static_cast<size_t>(y * size_ + x)];
                out = mix(out, c, 0.25f * static_cast<float>(covered));
            }
        }
    }

    void flames() {
        for (size_t i = 0; i < world_.primitives.size(); ++i) {
            const Primitive& p = world_.primitives[i];
            if (p.layer != Layer::kFlame) continue;
            const Rect r =
                cover(p, n_, [&](Vec3 at, float& x, float& y) { return camera_project(view_, n_, at, x, y); });
            for (int y = r.y0 / 2; y < (r.y1 + 1) / 2; ++y) {
                for (int x = r.x0 / 2; x < (r.x1 + 1) / 2; ++x) flame_pixel(p, static_cast<int16_t>(i), x, y);
            }
        }
    }

    Frame finish() {
        Frame f;
        f.size = size_;
        f.visible = opaque_.id;
        f.snow.resize(snow_.size());
        for (size_t i = 0; i < snow_.size(); ++i) f.snow[i] = snow_[i] > 0.5f ? 1 : 0;
        for (Vec3& c : colour_) {
            c = c * view_.exposure;
            c = {std::sqrt(clamp01(c.x)), std::sqrt(clamp01(c.y)), std::sqrt(clamp01(c.z))};
        }
        if (backdrop_.kind == BackdropKind::kWhite) keep_white();
        if (view_.blur > 0.0f) soften(view_.blur);
        f.pixels.resize(colour_.size() * 3);
        Rng rng(view_.grain_seed);
        for (size_t i = 0; i < colour_.size(); ++i) {
            uint64_t bits = view_.grain > 0.0f ? rng.next() : 0;
            for (int k = 0; k < 3; ++k, bits >>= 21) {
                // Uniform with the standard deviation `grain`.
                const float g =
                    view_.grain > 0.0f
                        ? view_.grain * 1.73f * (static_cast<float>(bits & 0x1fffff) * (2.0f / 2097152.0f) - 1.0f)
                        : 0.0f;
                f.pixels[3 * i + static_cast<size_t>(k)] =
                    static_cast<uint8_t>(255.0f * clamp01(colour_[i][k] + g) + 0.5f);
            }
        }
        return f;
    }

  private:
    Vec3 ray(int sx, int sy) const {
        return grid_.d + grid_.du * static_cast<float>(sx) + grid_.dv * static_cast<float>(sy);
    }

    Vec3 backdrop(int x, int y) const {
        const float inv = 1.0f / static_cast<float>(size_);
        return backdrop_at(backdrop_, first_, second_, (static_cast<float>(x) + 0.5f) * inv,
                           (static_cast<float>(y) + 0.5f) * inv);
    }

    bool has(Layer layer) const {
        return std::any_of(world_.primitives.begin(), world_.primitives.end(),
                           [&](const Primitive& p) { return p.layer == layer; });
    }

    void cast_layer(Layer layer, const float* limit, DepthBuffer& buffer) const {
        for (size_t i = 0; i < world_.primitives.size(); ++i) {
            const Primitive& p = world_.primitives[i];
            if (p.layer != layer) continue;
            const Rect r =
                cover(p, n_, [&](Vec3 at, float& x, float& y) { return camera_project(view_, n_, at, x, y); });
            cast(p, static_cast<int16_t>(i), grid_, r, limit, buffer);
        }
    }

    // An endless plane fades into the backdrop.
    Vec3 fade(Vec3 c, int16_t id, int sx, int sy, int x, int y) const {
        if (world_.primitives[static_cast<size_t>(id)].solid != Solid::kPlane) return c;
        const float t = opaque_.depth[static_cast<size_t>(sy * n_ + sx)];
        return mix(c, backdrop(x, y), smoothstep(14.0f, 40.0f, t));
    }

    Vec3 glass_colour(int16_t id, int sx, int sy, const std::vector<Vec3>& behind) const {
        const Primitive& p = world_.primitives[static_cast<size_t>(id)];
        const Paint& paint = world_.paints[static_cast<size_t>(p.paint)];
        const Vec3 d = ray(sx, sy), eye = normalized(-d);
        Hit hit;
        if (!intersect(p, to_local(p, view_.eye - p.centre), to_local(p, d), 0.02f, hit))
            return behind[static_cast<size_t>((sy / 2) * size_ + sx / 2)];
        const Vec3 n = normal_to_world(p, hit.normal);
        const float facing = clamp01(dot(n, eye)), grazing = 1.0f - facing;
        // Refraction as a displacement along the screen projection of the normal.
        const auto bend = [&](float c) { return static_cast<int>(std::floor(c * 7.0f * grazing + 0.5f)); };
        const int bx = std::clamp(sx / 2 - bend(dot(n, view_.axes.a)), 0, size_ - 1);
        const int by = std::clamp(sy / 2 + bend(dot(n, view_.axes.b)), 0, size_ - 1);
        const Vec3 through = behind[static_cast<size_t>(by * size_ + bx)];
        const Vec3 tint = paint.colour >= 0 ? mix({1, 1, 1}, paint.base, 0.72f) : Vec3{0.80f, 0.88f, 0.87f};
        const Vec3 mirror = n * (2.0f * dot(n, eye)) - eye;
        const float fresnel = 0.06f + 0.5f * grazing * grazing * grazing;
        const float rim = 1.0f - 0.62f * smoothstep(0.45f, 0.95f, grazing);
        const float spark = power_of_two(clamp01(dot(mirror, view_.key_direction)), 6);
        return through * tint * (rim * 0.94f) * mix(1.0f, p.shade, 0.5f) +
               surrounding(view_, mirror) * (fresnel * 0.75f) + Vec3{1, 1, 1} * (1.3f * spark);
    }

    void flame_pixel(const Primitive& p, int16_t id, int x, int y) {
        if (x < 0 || y < 0 || x >= size_ || y >= size_) return;
        const int sx = 2 * x, sy = 2 * y;
        const Vec3 d =
            grid_.d + grid_.du * (static_cast<float>(sx) + 0.5f) + grid_.dv * (static_cast<float>(sy) + 0.5f);
        Hit hit;
        const Vec3 o = to_local(p, view_.eye - p.centre), local_d = to_local(p, d);
        if (!intersect(p, o, local_d, 0.02f, hit)) return;
        const auto at = static_cast<size_t>(sy * n_ + sx);
        if (hit.t > opaque_.depth[at]) return;
        const Vec3 local = o + local_d * hit.t;
        const float facing = std::fabs(dot(normalized(normal_to_world(p, hit.normal)), normalized(d)));
        const float lick = noise((local * Vec3{1.6f, 1.6f, 1.1f}) * 1.7f + Vec3{p.shade * 40.0f, 0, 3});
        // Pointed above, round below.
        const float body = facing * (1.0f - 0.55f * clamp01(local.z)) + 0.5f * (lick - 0.5f);
        const float alpha = smoothstep(0.18f, 0.55f, body) * 0.92f;
        const float heat = clamp01(0.85f * body + 0.25f - 0.45f * local.z);
        const Vec3 cool{0.85f, 0.10f, 0.005f}, warm{1.0f, 0.36f, 0.02f}, hot{1.0f, 0.86f, 0.32f};
        const Vec3 c = heat < 0.5f ? mix(cool, warm, heat * 2.0f) : mix(warm, hot, heat * 2.0f - 1.0f);
        Vec3& out = colour_[static_cast<size_t>(y * size_ + x)];
        out = mix(out, c, alpha);
        if (alpha < 0.4f) return;
        snow_[static_cast<size_t>(y * size_ + x)] = 0.0f;
        for (int k = 0; k < 4; ++k) opaque_.id[static_cast<size_t>((sy + (k >> 1)) * n_ + sx + (k & 1))] = id;
    }

    // Exposure must not turn a pure white backdrop grey.
    void keep_white() {
        for (int y = 0; y < size_; ++y) {
            for (int x = 0; x < size_; ++x) {
                int empty = 0;
                for (int k = 0; k < 4; ++k)
                    empty += opaque_.id[static_cast<size_t>((2 * y + (k >> 1)) * n_ + 2 * x + (k & 1))] < 0;
                if (empty == 4) colour_[static_cast<size_t>(y * size_ + x)] = {1, 1, 1};
            }
        }
    }

    void soften(float amount) {
        const std::vector<Vec3> sharp = colour_;
        const float side = 0.25f * amount;
        for (const bool across : {true, false}) {
            const std::vector<Vec3> in = colour_;
            for (int y = 0; y < size_; ++y) {
                for (int x = 0; x < size_; ++x) {
                    const auto get = [&](int dx) {
                        const int px = std::clamp(x + (across ? dx : 0), 0, size_ - 1),
                                  py = std::clamp(y + (across ? 0 : dx), 0, size_ - 1);
                        return in[static_cast<size_t>(py * size_ + px)];
                    };
                    colour_[static_cast<size_t>(y * size_ + x)] =
                        get(0) * (1.0f - 2.0f * side) + (get(-1) + get(1)) * side;
                }
            }
        }
    }

    const World& world_;
    const View& view_;
    int size_, n_;
    Shader shader_;
    DepthBuffer opaque_;
    std::vector<Vec3> colour_;
    std::vector<float> snow_;
    RayGrid grid_;
    BackdropSpec backdrop_;
    Paint first_, second_;
};

}  // namespace

Frame render(const World& world, const View& view, const BackdropSpec& backdrop, int size) {
    Painter painter(world, view, backdrop, size);
    painter.opaque();
    painter.glass();
    painter.flames();
    return painter.finish();
}

}  // namespace fieldgraft::generator
