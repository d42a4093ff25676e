#include "models/generator/raster.h"

namespace fieldgraft::generator {

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

}  // namespace fieldgraft::generator
