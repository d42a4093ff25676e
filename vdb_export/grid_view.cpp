#include "vdb_export/grid_view.h"

#include <openvdb/math/Ray.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/RayIntersector.h>

#include <cmath>

#include "core/base/errors.h"
#include "core/base/spans.h"
#include "core/field/torch_parallel.h"
#include "vdb_export/sampling.h"
#include "vdb_export/vdb_grids.h"

namespace fieldgraft {
namespace {

using openvdb::Vec3d;
using Intersector = openvdb::tools::VolumeRayIntersector<openvdb::FloatGrid>;

constexpr std::int64_t rays_a_task = 256;

// Model coordinates to the user's world: the inverse of the frame, a similarity s·Q with det > 0 or < 0 alike.
Vec3d world_direction(const FieldGeometry& geometry, const Vec3d& v) {
    const auto& f = geometry.frame;
    const double scale = frame_scale(geometry);
    Vec3d world;
    for (int c = 0; c < 3; ++c) world[c] = (f[c] * v[0] + f[4 + c] * v[1] + f[8 + c] * v[2]) / (scale * scale);
    return world;
}

Vec3d world_point(const FieldGeometry& geometry, const Vec3d& p) {
    const auto& f = geometry.frame;
    return world_direction(geometry, {p[0] - f[3], p[1] - f[7], p[2] - f[11]});
}

// One thread's way through the grids.
class Walker {
  public:
    Walker(const VdbGrids& grids, const Intersector& intersector, const FieldGeometry& geometry,
           const GridViewOptions& options)
        : grids_(grids),
          intersector_(intersector),
          density_(grids.density->getConstAccessor()),
          color_(grids.color->getConstAccessor()),
          geometry_(geometry),
          options_(options) {}

    // color 3, transmittance, depth.
    void draw(const float* origin, const float* direction, float* color, float& transmittance, float& depth) {
        const Vec3d o = world_point(geometry_, {origin[0], origin[1], origin[2]});
        const Vec3d d = world_direction(geometry_, {direction[0], direction[1], direction[2]});
        const openvdb::math::Transform& transform = grids_.density->transform();
        // Both in index space with the ray's own parameter: t counts model units of the direction given.
        const Vec3d eye = transform.worldToIndex(o), along = transform.worldToIndex(o + d) - eye;
        const double step = options_.step / along.length(), world_step = step * d.length();
        double optical_depth = 0, sum[3] = {}, weights = 0, distance = 0;
        const double limit = -std::log(options_.min_transmittance);
        const auto sample = [&](double t) {
            const Vec3d at = eye + t * along;
            const double a = openvdb::tools::BoxSampler::sample(density_, at) * world_step;
            if (!(a > 0)) return;
            const openvdb::Vec3f c = openvdb::tools::BoxSampler::sample(color_, at);
            const double weight = -std::expm1(-a) * std::exp(-optical_depth);
            for (int i = 0; i < 3; ++i) sum[i] += weight * c[i];
            weights += weight;
            distance += weight * t;
            optical_depth += a;
        };
        double t0 = 0, t1 = 0;
        const double unit = along.length();
        // The intersector wants a direction of length 1; steps lie at whole multiples, whatever nodes they fall in.
        if (intersector_.setIndexRay(openvdb::math::Ray<double>(eye, along / unit, 1e-9))) {
            std::int64_t next = 0;
            while (optical_depth <= limit && intersector_.march(t0, t1)) {
                next = std::max(next, static_cast<std::int64_t>(std::ceil(t0 / unit / step - 0.5)));
                for (; (static_cast<double>(next) + 0.5) * step <= t1 / unit && optical_depth <= limit; ++next) {
                    sample((static_cast<double>(next) + 0.5) * step);
                }
            }
        }
        for (int i = 0; i < 3; ++i) color[i] = static_cast<float>(sum[i]);
        transmittance = static_cast<float>(std::exp(-optical_depth));
        depth = weights > 0 ? static_cast<float>(distance / weights) : 0.0f;
    }

  private:
    const VdbGrids& grids_;
    Intersector intersector_;
    openvdb::FloatGrid::ConstAccessor density_;
    openvdb::Vec3SGrid::ConstAccessor color_;
    const FieldGeometry& geometry_;
    const GridViewOptions& options_;
};

}  // namespace

RenderedRays render_grids(const std::filesystem::path& path, const FieldGeometry& geometry, const RayBundle& rays,
                          const GridViewOptions& options) {
    if (!(options.step > 0)) throw std::invalid_argument("render_grids: the step must be positive");
    at::NoGradGuard no_grad;
    const VdbGrids grids = load_grids(path);
    const std::int64_t count = rays.size();
    RenderedRays out{at::zeros({count, 3}, at::kFloat), at::zeros({count}, at::kFloat), at::zeros({count}, at::kFloat)};
    if (grids.density->activeVoxelCount() == 0) return out;
    // Interpolation reaches one voxel beyond the active ones.
    const Intersector intersector(*grids.density, 1);
    const Tensor origins = rays.origins.contiguous(), directions = rays.directions.contiguous();
    const Tensor transmittance = at::ones({count}, at::kFloat);
    share_out((count + rays_a_task - 1) / rays_a_task, [&](std::int64_t task) {
        Walker walker(grids, intersector, geometry, options);
        for (std::int64_t r = task * rays_a_task; r < std::min((task + 1) * rays_a_task, count); ++r) {
            walker.draw(origins.data_ptr<float>() + 3 * r, directions.data_ptr<float>() + 3 * r,
                        out.color.data_ptr<float>() + 3 * r, transmittance.data_ptr<float>()[r],
                        out.depth.data_ptr<float>()[r]);
        }
    });
    at::sub_out(out.alpha, at::ones_like(transmittance), transmittance);
    return out;
}

}  // namespace fieldgraft
