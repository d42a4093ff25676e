#include "models/generator/shapes.h"

#include <stdexcept>

namespace fieldgraft::generator {

Primitive* Builder::add(const Primitive& p) {
    primitives_.push_back(p);
    primitives_.back().shade = 1.0f + 0.07f * rng.bell();
    bool keep = true;
    for (const int part : absent_) keep = keep && part != p.part;
    kept_.push_back(keep);
    return &primitives_.back();
}

Primitive* Builder::box(int part, Vec3 centre, Vec3 half, const Mat3& rotation) {
    Primitive p;
    p.part = static_cast<int16_t>(part);
    p.centre = centre;
    p.half = half;
    p.rotation = rotation;
    return add(p);
}

Primitive* Builder::ball(int part, Vec3 centre, Vec3 radii, const Mat3& rotation) {
    Primitive* p = box(part, centre, radii, rotation);
    p->solid = Solid::kSphere;
    return p;
}

Primitive* Builder::dome(int part, Vec3 centre, Vec3 radii, const Mat3& rotation) {
    Primitive* p = box(part, centre, radii, rotation);
    p->solid = Solid::kDome;
    return p;
}

Primitive* Builder::rod(int part, Vec3 a, Vec3 b, float r0, float r1) {
    // The wider end is local z = −1, so that `shape` stays at most 1.
    if (r1 > r0) {
        std::swap(a, b);
        std::swap(r0, r1);
    }
    const Vec3 axis = b - a;
    Primitive* p = box(part, (a + b) * 0.5f, {r0, r0, 0.5f * length(axis)}, frame_along(normalized(axis)));
    p->solid = Solid::kFrustum;
    p->shape = r1 / r0;
    return p;
}

Primitive* Builder::ring(int part, Vec3 centre, Vec3 axis, float major, float minor) {
    Primitive* p = box(part, centre, {major, major, major}, frame_along(normalized(axis)));
    p->solid = Solid::kTorus;
    p->shape = minor / major;
    return p;
}

Primitive* Builder::wedge(int part, Vec3 centre, Vec3 half, const Mat3& rotation) {
    Primitive* p = box(part, centre, half, rotation);
    p->solid = Solid::kWedge;
    return p;
}

Primitive* Builder::gable(int part, Vec3 centre, Vec3 half, const Mat3& rotation) {
    Primitive* p = box(part, centre, half, rotation);
    p->solid = Solid::kGable;
    return p;
}

Primitive* Builder::pyramid(int part, Vec3 centre, Vec3 half, const Mat3& rotation) {
    Primitive* p = box(part, centre, half, rotation);
    p->solid = Solid::kPyramid;
    return p;
}

void Builder::wheel(int part, Vec3 centre, float radius, float half_width) {
    rod(part, centre - Vec3{0, half_width, 0}, centre + Vec3{0, half_width, 0}, radius);
    const float hub = half_width * 1.15f;
    rod(part, centre - Vec3{0, hub, 0}, centre + Vec3{0, hub, 0}, radius * 0.45f)->shade = 1.9f;
}

void Builder::greebles(int part, Vec3 centre, Vec3 half, int count) {
    for (int i = 0; i < count; ++i) {
        const Vec3 at = centre + Vec3{half.x * rng.uniform(-0.8f, 0.8f), half.y * rng.uniform(-0.8f, 0.8f), half.z};
        const float s = std::min(half.x, half.y) * rng.uniform(0.12f, 0.35f);
        if (rng.chance(0.6f)) {
            box(part, at, {s, s * rng.uniform(0.5f, 1.5f), s * rng.uniform(0.4f, 1.2f)})->shade =
                rng.uniform(0.7f, 1.1f);
        } else {
            rod(part, at, at + Vec3{0, 0, s * rng.uniform(0.5f, 2.0f)}, s * 0.7f);
        }
    }
}

void Builder::pattern(float spacing) {
    primitives_.back().pattern = spacing;
}

Builder::Result Builder::finish() {
    Vec3 lo{1e9f, 1e9f, 1e9f}, hi{-1e9f, -1e9f, -1e9f}, top;
    float top_z = -1e9f, top_width = 0.1f;
    for (const Primitive& p : primitives_) {
        const Vec3 bound = world_bound(p);
        lo = minimum(lo, p.centre - bound);
        hi = maximum(hi, p.centre + bound);
        if (p.centre.z + bound.z > top_z) {
            top_z = p.centre.z + bound.z;
            top = {p.centre.x, p.centre.y, top_z};
            top_width = std::max(bound.x, bound.y);
        }
    }
    if (anchor_width_ <= 0.0f) anchor(top, top_width);
    const Vec3 half = (hi - lo) * 0.5f, middle{(lo.x + hi.x) * 0.5f, (lo.y + hi.y) * 0.5f, lo.z};
    const float scale = 1.0f / std::max({half.x, half.y, half.z});
    Result result;
    for (size_t i = 0; i < primitives_.size(); ++i) {
        if (!kept_[i]) continue;
        Primitive p = primitives_[i];
        p.centre = (p.centre - middle) * scale;
        p.half = p.half * scale;
        p.pattern *= scale;
        result.primitives.push_back(p);
    }
    result.half = half * scale;
    result.anchor = (anchor_ - middle) * scale;
    result.anchor_width = anchor_width_ * scale;
    return result;
}

namespace {

const std::vector<ShapeInfo>& registry() {
    static const std::vector<ShapeInfo> shapes = [] {
        std::vector<ShapeInfo> all;
        for (auto list : {basic_shapes(), furniture_shapes(), vehicle_shapes(), living_shapes(), thing_shapes()}) {
            all.insert(all.end(), list.begin(), list.end());
        }
        return all;
    }();
    return shapes;
}

}  // namespace

int shape_count() {
    return static_cast<int>(registry().size());
}

const ShapeInfo& shape_info(int shape) {
    return registry().at(static_cast<size_t>(shape));
}

int shape_named(std::string_view name) {
    for (int i = 0; i < shape_count(); ++i) {
        if (shape_info(i).name == name) return i;
    }
    throw std::invalid_argument("shape_named: there is no shape \"" + std::string(name) + "\"");
}

}  // namespace fieldgraft::generator
