// Cell grids over a field's box (occupancy, support, regions): which points lie in a marked cell, and where cells are.
//
// A grid is R×R×R uint8 in (z, y, x) order; cell (i, j, k) spans box_min + edge·i/R … along each axis. Not
// differentiable.
#pragma once

#include "core/base/torch.h"
#include "core/field/geometry.h"

namespace fieldgraft {

// N bool: the point (N×3 float32, model coordinates) lies in the box and, where `grid` is defined, in a cell that is
// not 0.
Tensor in_cells(const FieldGeometry& geometry, const Tensor& grid, const Tensor& positions);

// The points of cells (z, y, x linear indices, M int64) at `offset` of their edges (½ is the centre): M×3 float32.
Tensor cell_points(const FieldGeometry& geometry, int resolution, const Tensor& cells, std::array<double, 3> offset);

// The grid at another resolution: a new cell is marked when a marked old cell overlaps it.
Tensor resampled_cells(const Tensor& grid, int resolution);

// OR of two grids at the finer one's resolution; the second where the first is undefined.
Tensor joined_cells(const Tensor& cells, const Tensor& more);
// OR of two grids of one size; the grid grown by n cells in every direction.
Tensor union_of(const Tensor& occupancy_a, const Tensor& occupancy_b);
Tensor dilated(const Tensor& occupancy, int cells);

// Throws std::invalid_argument naming `what` unless the grid is a cube of bytes.
void check_cells(const Tensor& grid, const char* what);

}  // namespace fieldgraft
