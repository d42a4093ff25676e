// Equal steps along rays through a box, skipping the empty cells of an occupancy grid: reference kernel.
//
// Sample k of a ray lies at t_k = near + (k + ½ + jitter)·step, kept when the point is inside the box and its cell is
// occupied. The grid is R×R×R bytes over the box, z slowest (cell (x, y, z) at (z·R + y)·R + x); no grid: all is
// occupied. Lengths in model units; origins and directions R×3 row-major, directions of length 1. Positions are N×3
// row-major.
//
// Empty cells are crossed in strides as long as the empty cube around them (Cohen & Sheffer 1994), each landing at or
// before its far side, so the samples are exactly those of the plain loop over k. Not differentiated. Count first, then
// fill: the layout needs the offsets.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/kernels/parallel.h"

namespace fieldgraft {

struct MarchGrid {
    std::array<double, 3> box_min{}, box_max{};
    int resolution = 0;  // 0: no grid
    // Cells in bricks of 4×4×4, one bit each (x fastest), padded with empty ones; bricks by z, y, x.
    std::vector<std::uint64_t> bricks;
    // Of each brick, how many bricks away the nearest one that is not empty lies (largest of the three axes; 255: or
    // further). What lies outside the box is empty.
    std::vector<std::uint8_t> distance;
    int bricks_an_edge = 0;
};

// cells: resolution³ bytes, not 0 where occupied.
MarchGrid make_march_grid(const std::array<double, 3>& box_min, const std::array<double, 3>& box_max, int resolution,
                          std::span<const std::uint8_t> cells);

struct MarchRays {
    std::span<const float> origins, directions;  // R×3
    std::span<const float> jitter;               // R, in [−½, ½); empty: 0
    double step = 0, near = 0;
};

// The samples of one ray, a few at a time: what a march that looks no further than it sees needs.
class RayMarcher {
  public:
    // The grid must outlive it; sizes are not checked.
    RayMarcher(const MarchGrid& grid, const MarchRays& rays, std::int64_t r);
    // The next sample's position (3 floats) and t; false when there is none.
    bool next(float* position, float& t);

  private:
    const MarchGrid* grid_;
    double step_, near_;
    double origin_[3], direction_[3];
    double cell_density_[3];             // cells per unit of length
    double cell_steps_[3];               // samples that fit into one cell's width along each axis; 0: parallel to it
    double first_t_;                     // t of sample 0
    std::int64_t sample_ = 0, end_ = 0;  // samples whose t lies inside the box, by a hair more rather than less
};

// counts[r] = number of samples of ray r.
void march_count(const MarchGrid& grid, const MarchRays& rays, std::span<std::int64_t> counts,
                 const ParallelFor& parallel_for);

// start as in the packed layout (R+1); writes ray, positions (N×3) and t of every sample.
void march_fill(const MarchGrid& grid, const MarchRays& rays, std::span<const std::int64_t> start,
                std::span<std::int64_t> ray, std::span<float> positions, std::span<float> t,
                const ParallelFor& parallel_for);

}  // namespace fieldgraft
