// Depth buffers over square grids of rays: the camera's and the shadow map's. Grids are affine: ray (x, y) starts at
// o + x ou + y ov and points along d + x du + y dv (x right, y down), so a primitive needs two additions a sample.
#pragma once

#include <cstdint>
#include <vector>

#include "models/generator/primitives.h"
#include "models/generator/world.h"

namespace fieldgraft::generator {

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

// Enters into the buffer every sample of the rectangle where the primitive is hit before what is there already (and
// before `limit`, if given).
void cast(const Primitive& p, int16_t index, const RayGrid& g, const Rect& r, const float* limit, DepthBuffer& buffer);
// n x n rays through the view's picture, and the sample that a point is seen at (false: behind the camera).
RayGrid camera_rays(const View& v, int n);
bool camera_project(const View& v, int n, Vec3 at, float& x, float& y);

}  // namespace fieldgraft::generator
