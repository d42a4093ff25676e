#include "core/render/hull.h"

#include <cmath>

#include "core/base/errors.h"
#include "core/base/shape.h"
#include "core/field/cells.h"
#include "core/render/march.h"

namespace fieldgraft {
namespace {

struct Counts {
    std::vector<int> seen, inside;
};

void check_view(const MaskView& view) {
    check_camera(view.camera);
    if (!view.mask.defined() || view.mask.dim() != 2 || view.mask.numel() == 0) {
        throw std::invalid_argument("a hull's mask must be H×W, not " + shape_text(view.mask));
    }
    if (view.depth.defined() && (view.depth.dim() != 2 || view.depth.numel() == 0)) {
        throw std::invalid_argument("a hull's depth must be H×W, not " + shape_text(view.depth));
    }
}

// The value at image coordinates (x, y in pixels of the camera) of a map of any resolution.
float at_pixel(const at::TensorAccessor<float, 2>& map, const Camera& camera, double x, double y) {
    const auto row = static_cast<std::int64_t>(y / camera.height * static_cast<double>(map.size(0)));
    const auto column = static_cast<std::int64_t>(x / camera.width * static_cast<double>(map.size(1)));
    return map[std::min(row, map.size(0) - 1)][std::min(column, map.size(1) - 1)];
}

void count_view(const MaskView& view, const Tensor& centres, double slack, Counts& counts) {
    const Camera& camera = view.camera;
    const Tensor image = project(camera, centres);  // x, y, depth along the axis
    const Tensor mask = view.mask.to(at::kFloat).contiguous();
    const Tensor depth = view.depth.defined() ? view.depth.to(at::kFloat).contiguous() : at::zeros({1, 1});
    const auto pixel = image.accessor<double, 2>();
    const auto point = centres.accessor<float, 2>();
    const auto mask_at = mask.accessor<float, 2>(), depth_at = depth.accessor<float, 2>();
    const Vec3 eye = camera.position();
    at::parallel_for(0, centres.size(0), 8192, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i) {
            const double x = pixel[i][0], y = pixel[i][1];
            if (!(pixel[i][2] > 0) || !(x >= 0 && x < camera.width && y >= 0 && y < camera.height)) continue;
            if (view.depth.defined()) {
                const float surface = at_pixel(depth_at, camera, x, y);
                const double distance = std::hypot(point[i][0] - eye[0], point[i][1] - eye[1], point[i][2] - eye[2]);
                if (surface > 0 && distance > surface + slack) continue;
            }
            ++counts.seen[static_cast<std::size_t>(i)];
            counts.inside[static_cast<std::size_t>(i)] += at_pixel(mask_at, camera, x, y) > 0.5f;
        }
    });
}

}  // namespace

Tensor hull_votes(const FieldGeometry& geometry, const std::vector<MaskView>& views, const HullOptions& options) {
    if (views.empty()) throw std::invalid_argument("a hull needs views");
    if (options.resolution < 1 || options.resolution > 1024 || options.min_views < 1) {
        throw std::invalid_argument(
            fmt::format("a hull of {}³ cells out of at least {} views", options.resolution, options.min_views));
    }
    const std::int64_t side = options.resolution, cells = side * side * side;
    const Tensor centres =
        cell_points(geometry, options.resolution, at::arange(cells, at::kLong), {0.5, 0.5, 0.5}).contiguous();
    Counts counts{std::vector<int>(static_cast<std::size_t>(cells)), std::vector<int>(static_cast<std::size_t>(cells))};
    for (const MaskView& view : views) {
        check_view(view);
        count_view(view, centres, options.slack, counts);
    }
    Tensor votes = at::empty({cells}, at::kFloat);
    float* out = votes.mutable_data_ptr<float>();
    for (std::size_t i = 0; i < counts.seen.size(); ++i) {
        out[i] = counts.seen[i] < options.min_views
                     ? -1.0f
                     : static_cast<float>(counts.inside[i]) / static_cast<float>(counts.seen[i]);
    }
    return votes.view({side, side, side});
}

Tensor visual_hull(const FieldGeometry& geometry, const std::vector<MaskView>& views, const HullOptions& options) {
    if (!(options.share > 0 && options.share <= 1)) {
        throw std::invalid_argument(fmt::format("a hull's share must lie in (0, 1], not {}", options.share));
    }
    const Tensor agreed = hull_votes(geometry, views, options).ge(options.share - 1e-6).to(at::kByte);
    return dilated(agreed, options.grow);
}

}  // namespace fieldgraft
