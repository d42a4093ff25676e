#include "core/field/cells.h"

#include <algorithm>
#include <cmath>

#include "core/base/errors.h"
#include "core/base/shape.h"

namespace fieldgraft {
namespace {

constexpr std::int64_t points_per_task = 16384;

}  // namespace

void check_cells(const Tensor& grid, const char* what) {
    const bool cube = grid.defined() && grid.dim() == 3 && grid.size(0) > 0 && grid.size(0) == grid.size(1) &&
                      grid.size(1) == grid.size(2) && grid.scalar_type() == at::kByte && grid.is_cpu();
    if (!cube) throw std::invalid_argument(fmt::format("{} must be a cube of bytes, not {}", what, shape_text(grid)));
}

Tensor in_cells(const FieldGeometry& geometry, const Tensor& grid, const Tensor& positions) {
    if (positions.dim() != 2 || positions.size(1) != 3 || positions.scalar_type() != at::kFloat) {
        throw std::invalid_argument("positions must be float32 N×3, not " + shape_text(positions));
    }
    if (grid.defined()) check_cells(grid, "the grid");
    const Tensor points = positions.contiguous(), cells = grid.defined() ? grid.contiguous() : grid;
    const std::int64_t resolution = grid.defined() ? grid.size(0) : 1;
    const std::uint8_t* marks = grid.defined() ? cells.const_data_ptr<std::uint8_t>() : nullptr;
    Tensor inside = at::empty({points.size(0)}, at::kBool);
    const float* p = points.const_data_ptr<float>();
    bool* out = inside.mutable_data_ptr<bool>();
    at::parallel_for(0, points.size(0), points_per_task, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i) {
            std::int64_t cell = 0;
            bool in = true;
            for (int axis = 2; axis >= 0; --axis) {
                const double low = geometry.box_min[axis], high = geometry.box_max[axis], x = p[3 * i + axis];
                in = in && x >= low && x <= high;
                const double place = in ? (x - low) / (high - low) * static_cast<double>(resolution) : 0;
                cell = cell * resolution + std::min(static_cast<std::int64_t>(place), resolution - 1);
            }
            out[i] = in && (marks == nullptr || marks[cell] != 0);
        }
    });
    return inside;
}

Tensor cell_points(const FieldGeometry& geometry, int resolution, const Tensor& cells, std::array<double, 3> offset) {
    if (resolution < 1) throw std::invalid_argument(fmt::format("resolution must be at least 1, not {}", resolution));
    const Tensor x = cells.remainder(resolution), y = cells.floor_divide(resolution).remainder(resolution),
                 z = cells.floor_divide(static_cast<std::int64_t>(resolution) * resolution);
    Tensor points = at::stack({x, y, z}, 1).to(at::kDouble);
    for (int axis = 0; axis < 3; ++axis) {
        const double edge = (geometry.box_max[axis] - geometry.box_min[axis]) / resolution;
        points.select(1, axis).add_(offset[axis]).mul_(edge).add_(geometry.box_min[axis]);
    }
    return points.to(at::kFloat);
}

Tensor resampled_cells(const Tensor& grid, int resolution) {
    check_cells(grid, "the grid");
    if (resolution < 1) throw std::invalid_argument(fmt::format("resolution must be at least 1, not {}", resolution));
    const std::int64_t from = grid.size(0);
    if (from == resolution) return grid.ne(0).to(at::kByte);
    Tensor marks = grid.ne(0);
    for (int axis = 0; axis < 3; ++axis) {  // a box of cells is a product of three ranges
        std::vector<Tensor> slabs;
        for (std::int64_t i = 0; i < resolution; ++i) {
            const std::int64_t first = i * from / resolution, last = ((i + 1) * from - 1) / resolution;
            slabs.push_back(marks.narrow(axis, first, last - first + 1).any(axis));
        }
        marks = at::stack(slabs, axis);
    }
    return marks.to(at::kByte).contiguous();
}

Tensor joined_cells(const Tensor& cells, const Tensor& more) {
    if (!cells.defined()) return more;
    const int finer = static_cast<int>(std::max(cells.size(0), more.size(0)));
    return union_of(resampled_cells(cells, finer), resampled_cells(more, finer));
}

Tensor union_of(const Tensor& occupancy_a, const Tensor& occupancy_b) {
    if (occupancy_a.sizes() != occupancy_b.sizes()) {
        throw std::invalid_argument("occupancies " + shape_text(occupancy_a) + " and " + shape_text(occupancy_b) +
                                    " differ in size");
    }
    return occupancy_a.ne(0).logical_or_(occupancy_b.ne(0)).to(at::kByte);
}

Tensor dilated(const Tensor& occupancy, int cells) {
    if (occupancy.dim() != 3)
        throw std::invalid_argument("occupancy must have three axes, not " + shape_text(occupancy));
    if (cells < 0) throw std::invalid_argument(fmt::format("cells to grow by must not be negative: {}", cells));
    Tensor grown = occupancy.ne(0).to(at::kByte);
    // A cube is the product of three segments: one axis after the other, one cell at a time.
    for (int axis = 0; axis < 3; ++axis) {
        const std::int64_t n = grown.size(axis);
        for (int i = 0; i < cells && n > 1; ++i) {
            const Tensor before = grown.clone();
            grown.narrow(axis, 1, n - 1).bitwise_or_(before.narrow(axis, 0, n - 1));
            grown.narrow(axis, 0, n - 1).bitwise_or_(before.narrow(axis, 1, n - 1));
        }
    }
    return grown;
}

}  // namespace fieldgraft
