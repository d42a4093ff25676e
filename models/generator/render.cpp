#include "models/generator/render.h"

#include <array>

#include "models/generator/shade.h"

namespace fieldgraft::generator {
namespace {

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
        for (int y = 0; y < size_; ++y) {
            for (int x = 0; x < size_; ++x) resolve(x, y);
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
                    const size_t at = sample(x, y, k);
                    if (front.id[at] < 0) continue;
                    opaque_.id[at] = front.id[at];
                    opaque_.depth[at] = front.depth[at];
                    ++covered;
                    if (first < 0) first = k;
                }
                if (covered == 0) continue;
                const size_t at = sample(x, y, first);
                const auto seen = [&](int right, int up) {
                    return behind[pixel(std::clamp(x + right, 0, size_ - 1), std::clamp(y - up, 0, size_ - 1))];
                };
                const Vec3 c = shader_.glass(world_.primitives[static_cast<size_t>(front.id[at])],
                                             ray(2 * x + (first & 1), 2 * y + (first >> 1)), seen);
                Vec3& out = colour_[pixel(x, y)];
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
            for (int y = r.y0 / 2; y < std::min((r.y1 + 1) / 2, size_); ++y) {
                for (int x = r.x0 / 2; x < std::min((r.x1 + 1) / 2, size_); ++x)
                    flame_pixel(p, static_cast<int16_t>(i), x, y);
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
        if (view_.blur > 0.0f) soften(view_.blur);
        quantise(f.pixels);
        return f;
    }

  private:
    size_t pixel(int x, int y) const { return static_cast<size_t>(y * size_ + x); }
    size_t sample(int x, int y, int k) const { return static_cast<size_t>((2 * y + (k >> 1)) * n_ + 2 * x + (k & 1)); }

    Vec3 ray(int sx, int sy) const {
        return grid_.d + grid_.du * static_cast<float>(sx) + grid_.dv * static_cast<float>(sy);
    }

    Vec3 backdrop(int x, int y) const {
        // White stays white whatever the exposure.
        if (backdrop_.kind == BackdropKind::kWhite) return Vec3{1, 1, 1} * (1.0f / view_.exposure);
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

    // Means the samples of a pixel, shading each primitive in it once.
    void resolve(int x, int y) {
        std::array<Vec3, 4> shaded;
        std::array<int16_t, 4> ids;
        for (int k = 0; k < 4; ++k) ids[static_cast<size_t>(k)] = opaque_.id[sample(x, y, k)];
        const size_t at = pixel(x, y);
        if (ids[0] < 0 && ids[1] < 0 && ids[2] < 0 && ids[3] < 0) {
            colour_[at] = backdrop(x, y);
            return;
        }
        Vec3 sum;
        for (size_t k = 0; k < 4; ++k) {
            const auto same = static_cast<size_t>(std::find(ids.begin(), ids.end(), ids[k]) - ids.begin());
            if (same < k) {
                shaded[k] = shaded[same];
            } else if (ids[k] < 0) {
                shaded[k] = backdrop(x, y);
            } else {
                const int sx = 2 * x + (static_cast<int>(k) & 1), sy = 2 * y + (static_cast<int>(k) >> 1);
                const Shading s = shader_.shade(world_.primitives[static_cast<size_t>(ids[k])], ray(sx, sy));
                shaded[k] = fade(s.colour, ids[k], sx, sy, x, y);
                snow_[at] = std::max(snow_[at], s.snow);
            }
            sum = sum + shaded[k];
        }
        colour_[at] = sum * 0.25f;
    }

    void flame_pixel(const Primitive& p, int16_t id, int x, int y) {
        const Vec3 d = grid_.d + grid_.du * (2.0f * static_cast<float>(x) + 0.5f) +
                       grid_.dv * (2.0f * static_cast<float>(y) + 0.5f);
        const Flame flame = flame_at(view_, p, d, opaque_.depth[sample(x, y, 0)]);
        Vec3& out = colour_[pixel(x, y)];
        out = mix(out, flame.colour, flame.alpha);
        if (flame.alpha < 0.4f) return;
        snow_[pixel(x, y)] = 0.0f;
        for (int k = 0; k < 4; ++k) opaque_.id[sample(x, y, k)] = id;
    }

    void quantise(std::vector<uint8_t>& pixels) const {
        pixels.resize(colour_.size() * 3);
        Rng rng(view_.grain_seed);
        for (size_t i = 0; i < colour_.size(); ++i) {
            uint64_t bits = view_.grain > 0.0f ? rng.next() : 0;
            for (int k = 0; k < 3; ++k, bits >>= 21) {
                // Uniform noise with the standard deviation `grain`.
                const float unit = static_cast<float>(bits & 0x1fffff) * (2.0f / 2097152.0f) - 1.0f;
                const float value = colour_[i][k] + view_.grain * 1.73f * unit;
                pixels[3 * i + static_cast<size_t>(k)] = static_cast<uint8_t>(255.0f * clamp01(value) + 0.5f);
            }
        }
    }

    void soften(float amount) {
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
                    colour_[pixel(x, y)] = get(0) * (1.0f - 2.0f * side) + (get(-1) + get(1)) * side;
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
