// Multiresolution hash encoding (Müller et al. 2022, "Instant Neural Graphics Primitives", sec. 3): reference kernel.
//
// Level l is a grid of resolution_l³ cells over the unit cube, resolution_l = ⌊base · b^l⌋ with b so that the last
// level has `finest` cells. Its (resolution_l + 1)³ vertices hold F features each, directly indexed where they fit into
// 2^log2_table_size entries ("dense"), else at (x · 1) xor (y · 2654435761) xor (z · 805459861) mod 2^log2_table_size.
// A point's features are trilinear in its cell.
//
// Layout: positions 3×n, features (levels·F)×n, both feature-major (row stride n): one level is F contiguous rows. The
// table is entries×F, level after level. Positions outside [0, 1] are clamped to the cube. Differentiable in the table;
// not in positions. Error: each feature is a sum of 8 products, relative error ≤ 12 ε of Σ|w f|. Backward sums in
// sample order within a level, so its bits do not depend on how levels are split between threads.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/kernels/parallel.h"

namespace fieldgraft {

struct HashGridLevel {
    int resolution = 0;         // cells along an edge
    std::uint32_t entries = 0;  // table entries of this level
    std::size_t offset = 0;     // first entry of this level
    bool dense = false;         // vertices are indexed directly, no two share an entry
};

struct HashGrid {
    int features = 0;
    std::vector<HashGridLevel> levels;
    std::size_t entries = 0;

    std::size_t rows() const { return levels.size() * static_cast<std::size_t>(features); }
};

// levels ≥ 1, features 1…8, log2_table_size 1…28, 1 ≤ base ≤ finest; throws std::invalid_argument.
HashGrid make_hash_grid(int levels, int features, int log2_table_size, int base, int finest);

// Encodes n = positions.size() / 3 points; `encoded` holds rows()·n values. One thread: callers split points into
// chunks.
template <class T>
void hash_grid_forward(const HashGrid& grid, std::span<const T> table, std::span<const T> positions,
                       std::span<T> encoded);

// One chunk of points and the gradient of its features, laid out as in the forward pass.
template <class T>
struct HashGridChunk {
    std::span<const T> positions;     // 3×n
    std::span<const T> encoded_grad;  // rows()×n
};

// table_grad += the gradient of all chunks. Levels are split between threads; no two threads touch one entry.
template <class T>
void hash_grid_backward(const HashGrid& grid, std::span<const HashGridChunk<T>> chunks, std::span<T> table_grad,
                        const ParallelFor& parallel_for);

}  // namespace fieldgraft
