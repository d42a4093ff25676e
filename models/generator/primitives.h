// Analytic ray hits with the solids that every picture is made of. A primitive is a unit solid in its own frame,
// scaled by half-sizes h and rotated and moved into the world: local = diag(1/h) R^T (world - centre).
// Solids (local): sphere |p| <= 1; dome = sphere with z >= 0; box |x|,|y|,|z| <= 1; frustum |z| <= 1 with radius
// going from 1 at z = -1 to `shape` at z = +1 (open: no lid, the inside is seen); torus with major radius 1 and minor
// radius `shape` around z; wedge x + z <= 0; gable 2|x| + z <= 1; pyramid 2|x| + z <= 1 and 2|y| + z <= 1 (the last
// three inside the box); plane z = 0. Directions are not normalised: t is the same in world and local frames.
// Torus hits are sphere-traced (distance error below 2e-3); all others are closed form.
#pragma once

#include <cstdint>

#include "models/generator/vec.h"

namespace fieldgraft::generator {

enum class Solid : uint8_t { kSphere, kDome, kBox, kFrustum, kTorus, kWedge, kGable, kPyramid, kPlane };
enum class Layer : uint8_t { kOpaque, kGlass, kFlame };

struct Primitive {
    Solid solid = Solid::kBox;
    Layer layer = Layer::kOpaque;
    bool open = false;
    float shape = 1.0f;
    Vec3 centre;
    Vec3 half{1, 1, 1};
    Mat3 rotation;
    int16_t object = 0;    // index into World::objects
    int16_t part = 0;      // Part
    int16_t paint = 0;     // index into World::paints
    float shade = 1.0f;    // brightness of this piece against its paint
    float pattern = 0.0f;  // > 0: studs or panel lines with this spacing
};

struct Hit {
    float t = 0.0f;
    Vec3 normal;  // local, not normalised
};

inline Vec3 inverse_half(const Primitive& p) {
    return {1.0f / p.half.x, 1.0f / p.half.y, 1.0f / p.half.z};
}
inline Vec3 to_local(const Primitive& p, Vec3 v) {
    return transposed_times(p.rotation, v) * inverse_half(p);
}
inline Vec3 normal_to_world(const Primitive& p, Vec3 n) {
    return normalized(p.rotation * (n * inverse_half(p)));
}

// First hit of o + t d with t > t_min; false if there is none.
bool intersect(const Primitive& p, Vec3 o, Vec3 d, float t_min, Hit& hit);
// Local rays o + x ou, d + x du along a row of samples.
struct RayRow {
    Vec3 o, ou, d, du;
};
// For samples x0 <= x < x1: where the first hit beyond t_min lies before depth[x] (and limit[x], if given), notes its t
// and `index`.
void intersect_row(const Primitive& p, const RayRow& ray, int x0, int x1, float t_min, const float* limit, float* depth,
                   int16_t* id, int16_t index);
// Half-extent of the local bounding box.
Vec3 local_bound(const Primitive& p);
// Half-extent of the world-aligned bounding box around the centre.
Vec3 world_bound(const Primitive& p);

}  // namespace fieldgraft::generator
