#include "core/kernels/march_ref.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace fieldgraft {
namespace {

constexpr int brick = 4;
constexpr std::int64_t rays_per_task = 64;

// Cells first … first + edge − 1 along each axis are empty; edge 0: there is something.
struct EmptyCube {
    int first[3], edge;
};

// Samples until the ray leaves the cube that holds the point p (in cells).
double steps_to_exit(const double* cell_steps, const double* p, const EmptyCube& cube) {
    double nearest = std::numeric_limits<double>::infinity();
    for (int c = 0; c < 3; ++c) {
        if (cell_steps[c] == 0) continue;
        const double face = cell_steps[c] > 0 ? cube.first[c] + cube.edge : cube.first[c];
        nearest = std::min(nearest, (face - p[c]) * cell_steps[c]);
    }
    return nearest;
}

// The empty cube around the point p (in cells).
EmptyCube empty_cube(const MarchGrid& grid, const double* p) {
    int cell[3];
    for (int c = 0; c < 3; ++c) cell[c] = std::clamp(static_cast<int>(p[c]), 0, grid.resolution - 1);
    const auto [x, y, z] = cell;
    const std::size_t bricks = grid.bricks_an_edge;
    const std::size_t number = (z / brick * bricks + y / brick) * bricks + x / brick;
    EmptyCube cube{};
    if (const int distance = grid.distance[number]; distance > 0) {
        for (int c = 0; c < 3; ++c) cube.first[c] = (cell[c] / brick - distance + 1) * brick;
        cube.edge = (2 * distance - 1) * brick;
        return cube;
    }
    const std::uint64_t bits = grid.bricks[number];
    const int at = (z % brick * brick + y % brick) * brick + x % brick;
    if (bits >> at & 1) return cube;
    // Its eighth of the brick: 2×2×2 cells, the first of them where the lowest bit of each coordinate is 0.
    constexpr std::uint64_t eighth = 0x330033;
    cube.edge = (bits >> (at & ~0b010101) & eighth) == 0 ? 2 : 1;
    for (int c = 0; c < 3; ++c) cube.first[c] = cell[c] & -cube.edge;
    return cube;
}

// Two passes over the bricks, each looking at the half of the neighbours it has been to: exact for the largest-axis
// distance (Borgefors 1986).
std::vector<std::uint8_t> brick_distances(const std::vector<std::uint64_t>& bricks, int edge) {
    constexpr std::uint8_t far = 255;
    std::vector<std::uint8_t> distance(bricks.size());
    for (std::size_t i = 0; i < bricks.size(); ++i) distance[i] = bricks[i] != 0 ? 0 : far;
    const auto inside = [edge](int v) { return v >= 0 && v < edge; };
    const auto pass = [&](int step) {
        const int begin = step > 0 ? 0 : edge - 1;
        for (int z = begin; inside(z); z += step) {
            for (int y = begin; inside(y); y += step) {
                for (int x = begin; inside(x); x += step) {
                    std::uint8_t& value = distance[(std::size_t(z) * edge + y) * edge + x];
                    for (int k = 0; k < 13 && value > 0; ++k) {
                        // The 13 neighbours that come before: of 27 in order, the first 13.
                        const int nz = z + step * (k / 9 - 1), ny = y + step * (k / 3 % 3 - 1),
                                  nx = x + step * (k % 3 - 1);
                        if (!inside(nx) || !inside(ny) || !inside(nz)) continue;
                        const int there = distance[(std::size_t(nz) * edge + ny) * edge + nx];
                        value = static_cast<std::uint8_t>(std::min<int>(value, std::min<int>(there + 1, far)));
                    }
                }
            }
        }
    };
    pass(1);
    pass(-1);
    return distance;
}

// Calls use(position, t) for every sample of ray r.
template <class Use>
void walk(const MarchGrid& grid, const MarchRays& rays, std::int64_t r, Use use) {
    RayMarcher marcher(grid, rays, r);
    float position[3], t;
    while (marcher.next(position, t)) use(position, t);
}

void check(const MarchGrid& grid, const MarchRays& rays) {
    const std::size_t count = rays.origins.size() / 3;
    if (rays.directions.size() != 3 * count || rays.origins.size() != 3 * count ||
        !(rays.jitter.empty() || rays.jitter.size() == count)) {
        throw std::invalid_argument("march: sizes do not match " + std::to_string(count) + " rays");
    }
    if (!(rays.step > 0) || !std::isfinite(rays.step)) {
        throw std::invalid_argument("march: the step must be positive, not " + std::to_string(rays.step));
    }
    if (grid.resolution > 0 && grid.distance.empty()) throw std::invalid_argument("march: the grid has no bricks");
}

}  // namespace

RayMarcher::RayMarcher(const MarchGrid& grid, const MarchRays& rays, std::int64_t r)
    : grid_(&grid), step_(rays.step), near_(rays.near) {
    double t_in = rays.near, t_out = std::numeric_limits<double>::infinity();
    for (int c = 0; c < 3; ++c) {
        origin_[c] = rays.origins[3 * r + c];
        direction_[c] = rays.directions[3 * r + c];
        const double inverse = 1.0 / direction_[c], extent = grid.box_max[c] - grid.box_min[c];
        cell_density_[c] = grid.resolution / extent;
        const double width = extent / std::max(grid.resolution, 1);
        cell_steps_[c] = direction_[c] == 0 ? 0.0 : width * inverse / step_;
        double a = (grid.box_min[c] - origin_[c]) * inverse, b = (grid.box_max[c] - origin_[c]) * inverse;
        if (a > b) std::swap(a, b);
        // 0 · inf is NaN when the ray runs inside a face's plane: no bound from that axis.
        t_in = a > t_in ? a : t_in;
        t_out = b < t_out ? b : t_out;
    }
    first_t_ = near_ + (0.5 + (rays.jitter.empty() ? 0.0 : rays.jitter[r])) * step_;
    if (!(t_in < t_out) || !std::isfinite(t_out)) return;
    sample_ = std::max<std::int64_t>(0, static_cast<std::int64_t>(std::floor((t_in - first_t_) / step_)));
    end_ = static_cast<std::int64_t>(std::ceil((t_out - first_t_) / step_)) + 1;
}

bool RayMarcher::next(float* position, float& distance) {
    while (sample_ < end_) {
        const double t = first_t_ + static_cast<double>(sample_) * step_;
        double p[3];  // in cells
        bool inside = t >= near_;
        for (int c = 0; c < 3; ++c) {
            position[c] = static_cast<float>(origin_[c] + t * direction_[c]);
            inside = inside && position[c] >= grid_->box_min[c] && position[c] <= grid_->box_max[c];
            p[c] = (position[c] - grid_->box_min[c]) * cell_density_[c];
        }
        const EmptyCube empty = inside && grid_->resolution > 0 ? empty_cube(*grid_, p) : EmptyCube{};
        std::int64_t stride = 1;
        if (empty.edge > 0) {
            const double steps = steps_to_exit(cell_steps_, p, empty);
            stride = steps > 2 ? static_cast<std::int64_t>(std::min(steps, 1e9)) : 1;
        }
        sample_ += stride;
        if (inside && empty.edge == 0) {
            distance = static_cast<float>(t);
            return true;
        }
    }
    return false;
}

MarchGrid make_march_grid(const std::array<double, 3>& box_min, const std::array<double, 3>& box_max, int resolution,
                          std::span<const std::uint8_t> cells) {
    for (int c = 0; c < 3; ++c) {
        if (!(box_min[c] < box_max[c])) throw std::invalid_argument("march: the box is empty");
    }
    const std::size_t n = static_cast<std::size_t>(std::max(resolution, 0));
    if (resolution < 0 || cells.size() != n * n * n) {
        throw std::invalid_argument("march: " + std::to_string(cells.size()) + " cells are not a cube of edge " +
                                    std::to_string(resolution));
    }
    const std::size_t bricks = (n + brick - 1) / brick;
    MarchGrid grid{box_min, box_max, resolution, {}, {}, static_cast<int>(bricks)};
    grid.bricks.assign(bricks * bricks * bricks, 0);
    for (std::size_t z = 0; z < n; ++z) {
        for (std::size_t y = 0; y < n; ++y) {
            const std::uint8_t* row = cells.data() + (z * n + y) * n;
            std::uint64_t* brick_row = grid.bricks.data() + (z / brick * bricks + y / brick) * bricks;
            const std::size_t at = (z % brick * brick + y % brick) * brick;
            for (std::size_t x = 0; x < n; ++x) {
                const std::uint64_t occupied = row[x] != 0;
                brick_row[x / brick] |= occupied << (at + x % brick);
            }
        }
    }
    grid.distance = brick_distances(grid.bricks, grid.bricks_an_edge);
    return grid;
}

void march_count(const MarchGrid& grid, const MarchRays& rays, std::span<std::int64_t> counts,
                 const ParallelFor& parallel_for) {
    check(grid, rays);
    parallel_for(static_cast<std::int64_t>(counts.size()), rays_per_task, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t r = begin; r < end; ++r) {
            std::int64_t count = 0;
            walk(grid, rays, r, [&](const float*, float) { ++count; });
            counts[r] = count;
        }
    });
}

void march_fill(const MarchGrid& grid, const MarchRays& rays, std::span<const std::int64_t> start,
                std::span<std::int64_t> ray, std::span<float> positions, std::span<float> t,
                const ParallelFor& parallel_for) {
    check(grid, rays);
    const std::int64_t count = static_cast<std::int64_t>(start.size()) - 1;
    parallel_for(count, rays_per_task, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t r = begin; r < end; ++r) {
            std::int64_t k = start[r];
            walk(grid, rays, r, [&](const float* position, float distance) {
                std::copy(position, position + 3, positions.data() + 3 * k);
                ray[k] = r;
                t[k++] = distance;
            });
        }
    });
}

}  // namespace fieldgraft
