// Light on surfaces: a key light with shadows, a fill light and an ambient term over Lambert's cosine, Schlick's
// Fresnel term for highlights and reflections, metals and glass that reflect a procedural surrounding. Linear colours.
#pragma once

#include <optional>

#include "models/generator/raster.h"
#include "models/generator/surface.h"
#include "models/generator/world.h"

namespace fieldgraft::generator {

// Depth along the key light. Softened by four taps; biased by 0.04 along the normal and 0.05 along the light.
class ShadowMap {
  public:
    ShadowMap(const World& world, const View& view);
    // 1 lit, 0 in shadow.
    float lit(Vec3 at, Vec3 normal) const;

  private:
    void texel(Vec3 at, float& x, float& y) const;

    Mat3 axes_;
    Vec3 centre_;
    float reach_ = 1.0f;
    DepthBuffer buffer_;
};

struct Shading {
    Vec3 colour;
    float snow = 0.0f;
};

class Shader {
  public:
    Shader(const World& world, const View& view);
    // What the primitive looks like where the ray along d meets it; black if it just misses.
    Shading shade(const Primitive& p, Vec3 d) const;
    // Glass: what is behind it, tinted, with reflections. `behind` is given the displacement by refraction in pixels
    // (right, up) and returns the colour there.
    template <typename Behind>
    Vec3 glass(const Primitive& p, Vec3 d, const Behind& behind) const;

  private:
    Vec3 light(const Surface& s, float tone, Vec3 at, Vec3 n, Vec3 eye, bool ground) const;
    Vec3 glass_over(const Primitive& p, Vec3 n, Vec3 eye, Vec3 through) const;

    const World& world_;
    const View& view_;
    Vec3 centre_;
    std::optional<ShadowMap> shadow_;
};

// A flame's colour and opacity where the ray meets it before `limit`; opacity 0 elsewhere.
struct Flame {
    Vec3 colour;
    float alpha = 0.0f;
};
Flame flame_at(const View& view, const Primitive& p, Vec3 d, float limit);

template <typename Behind>
Vec3 Shader::glass(const Primitive& p, Vec3 d, const Behind& behind) const {
    Hit hit;
    if (!intersect(p, to_local(p, view_.eye - p.centre), to_local(p, d), 0.02f, hit)) return behind(0, 0);
    const Vec3 n = normal_to_world(p, hit.normal), eye = normalized(-d);
    const float grazing = 1.0f - clamp01(dot(n, eye));
    // Refraction as a displacement along the screen projection of the normal.
    const auto bend = [&](Vec3 axis) { return static_cast<int>(std::floor(dot(n, axis) * 7.0f * grazing + 0.5f)); };
    return glass_over(p, n, eye, behind(-bend(view_.axes.a), -bend(view_.axes.b)));
}

}  // namespace fieldgraft::generator
