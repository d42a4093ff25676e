// Multiresolution hash encoding and its gradient: SIMD, dispatched at run time. What is computed is hash_grid_ref.h's.
//
// Layout: positions 3×n feature-major (three rows of n); encoded n rows of `row` floats (row ≥ grid.rows()), one row a
// sample, level after level; columns past grid.rows() are written as 0. Two and four features a level take
// the fast paths; other numbers are handed to the reference.
//
// Forward works through a level for many samples before the next, so that a level's table stays in the cache. Errors
// as in hash_grid_ref.h. Backward adds up runs of samples in one cell before it touches the table: rounding differs
// from the reference's, and bits do not depend on how levels are split between threads.
#pragma once

#include <cstddef>
#include <span>

#include "core/kernels/hash_grid_ref.h"

namespace fieldgraft {

// One thread.
void hash_grid_encode(const HashGrid& grid, std::span<const float> table, const float* positions, std::size_t n,
                      float* encoded, std::size_t row);

// The gradient of part of the samples: feature f of level l at sample s is encoded_grad[l·level_step + s·row + f].
// Level after level (row F, level_step n·F) is read fastest; rows as above are row, level_step F.
struct HashGridRows {
    const float* positions;  // 3×n
    const float* encoded_grad;
    std::size_t n, row, level_step;
};

// level_grad (this level's entries × F) += the gradient of all parts. One thread: callers split levels.
void hash_grid_add_gradient(const HashGrid& grid, int level, std::span<const HashGridRows> parts, float* level_grad);

}  // namespace fieldgraft
