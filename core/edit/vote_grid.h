// Votes of several views about where a text (or a user's mask) is, gathered in a grid of cells over the field's box.
//
// A view votes at the points its pixels see: pixel value v ∈ [0, 1] at every sample, weighted by the sample's share of
// the pixel, w = T α. The score of a cell is Σ w v / Σ w. One view's mistake is outvoted by the views that see the same
// cell; cells inside a body, which no view sees, take the mean of their neighbours' scores, layer by layer.
//
// Grids are R×R×R (z, y, x) over the box, model coordinates; points N×3 float32. Nothing here is differentiable.
#pragma once

#include "core/base/torch.h"
#include "core/field/geometry.h"

namespace fieldgraft {

// The flat cell index (z·R + y)·R + x of every point, −1 outside the box: N int64.
Tensor cell_of(const FieldGeometry& geometry, int resolution, const Tensor& points);
// Centres of all cells, R³×3, in flat order.
Tensor cell_centres(const FieldGeometry& geometry, int resolution);
// Trilinear value of a float R×R×R grid at the points (0 outside the box), cell centres being the nodes: N.
Tensor sample_grid(const Tensor& grid, const FieldGeometry& geometry, const Tensor& points);

// Scores scaled so that ½ is where the region ends: at `core_share` of what its core (the best tenth of the cells above
// ½) gets, but not below ½ of all votes. Seen from every side a body's own cells are agreed on; what it stands on or
// hides behind is called the same in some views only. Where no cell has ½ of the votes, `least_vote` takes its place:
// a region the views are not sure of is better shown than refused. Scores that stay below that are returned as they
// are.
constexpr double least_vote = 0.3;
Tensor scaled_to_border(const Tensor& score, double core_share);

class VoteGrid {
  public:
    VoteGrid(const FieldGeometry& geometry, int resolution);

    // votes and weights: N, colours: N×3; points outside the box are ignored.
    void add(const Tensor& points, const Tensor& votes, const Tensor& weights, const Tensor& colours);
    // Lets neighbouring cells of like colour agree: s ← (s⁰ + Σ k s') / (1 + Σ k) over the 26 neighbours that were
    // seen, k = 2 exp(−|c − c'|² / 2 tolerance²), `rounds` times. A view's mask is coarse and its errors hang together;
    // things mostly end where their colour does (after the fully connected CRFs of Krähenbühl and Koltun, 2011).
    void agree_by_colour(double tolerance, int rounds);
    // The marked cells (R³ bool) and those that are joined to them, from neighbour to neighbour, by steps in colour of
    // at most `tolerance`, through seen cells that `allowed` marks.
    Tensor grown_by_colour(const Tensor& cells, const Tensor& allowed, double tolerance) const;
    // R×R×R in [0, 1]; 0 where neither a vote nor `reach` layers of neighbours say anything.
    Tensor score(int reach) const;
    // Σ w of every cell.
    const Tensor& weight() const { return weight_; }
    int resolution() const { return resolution_; }

  private:
    // The cells that were seen (flat, M) and for each its 26 neighbours: places among those cells (M×26, 0 for one that
    // was not seen), whether seen (M×26 bool), squared difference of colour (M×26).
    struct SeenCells {
        Tensor cells, neighbours, seen, apart;
    };
    SeenCells seen_cells() const;

    FieldGeometry geometry_;
    int resolution_;
    Tensor votes_, weight_;  // R³ float32
    Tensor colours_;         // R³×3, Σ w c
};

}  // namespace fieldgraft
