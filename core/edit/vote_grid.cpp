#include "core/edit/vote_grid.h"

#include <algorithm>
#include <stdexcept>

#include "core/base/errors.h"

namespace fieldgraft {

namespace {

// A cell that hardly anything was seen of says as little as one that was not seen.
constexpr float least_weight = 0.05f;

void check_points(const Tensor& points) {
    if (!points.defined() || points.dim() != 2 || points.size(1) != 3)
        throw std::invalid_argument("vote grid: points must be N×3");
}

// Box-relative coordinates in [0, 1].
Tensor normalised(const FieldGeometry& geometry, const Tensor& points) {
    check_points(points);
    const auto& low = geometry.box_min;
    const auto& high = geometry.box_max;
    const Tensor origin = at::tensor({low[0], low[1], low[2]}, points.options());
    const Tensor size = at::tensor({high[0] - low[0], high[1] - low[1], high[2] - low[2]}, points.options());
    return (points - origin) / size;
}

int cube_resolution(const Tensor& grid) {
    if (!grid.defined() || grid.dim() != 3 || grid.size(0) != grid.size(1) || grid.size(1) != grid.size(2))
        throw std::invalid_argument("vote grid: an R×R×R grid is expected");
    return static_cast<int>(grid.size(0));
}

// Sum over the 3×3×3 neighbourhood.
Tensor neighbourhood_sum(const Tensor& grid) {
    return at::avg_pool3d(grid.unsqueeze(0).unsqueeze(0), 3, 1, 1, false, true).squeeze(0).squeeze(0) * 27;
}

}  // namespace

Tensor cell_of(const FieldGeometry& geometry, int resolution, const Tensor& points) {
    const Tensor relative = normalised(geometry, points);
    const Tensor inside = (relative >= 0).logical_and(relative < 1).all(1);
    const Tensor cell = (relative * resolution).floor().to(at::kLong).clamp(0, resolution - 1);
    const Tensor flat = (cell.select(1, 2) * resolution + cell.select(1, 1)) * resolution + cell.select(1, 0);
    return at::where(inside, flat, at::full_like(flat, -1));
}

Tensor cell_centres(const FieldGeometry& geometry, int resolution) {
    std::array<Tensor, 3> axis;
    for (int a = 0; a < 3; ++a) {
        const double size = (geometry.box_max[a] - geometry.box_min[a]) / resolution;
        axis[a] = ((at::arange(resolution, at::kDouble) + 0.5) * size + geometry.box_min[a]).to(at::kFloat);
    }
    const std::vector<Tensor> zyx = at::meshgrid({axis[2], axis[1], axis[0]}, "ij");
    return at::stack({zyx[2].reshape(-1), zyx[1].reshape(-1), zyx[0].reshape(-1)}, 1);
}

Tensor sample_grid(const Tensor& grid, const FieldGeometry& geometry, const Tensor& points) {
    cube_resolution(grid);
    if (points.size(0) == 0) return at::zeros({0}, grid.options());
    const Tensor where = (normalised(geometry, points) * 2 - 1).to(grid.scalar_type()).reshape({1, 1, 1, -1, 3});
    return at::grid_sampler_3d(grid.unsqueeze(0).unsqueeze(0), where, 0, 0, false).reshape(-1);
}

Tensor scaled_to_border(const Tensor& score, double core_share) {
    const double peak = score.numel() > 0 ? score.max().item<double>() : 0;
    const double least = peak > 0.5 ? 0.5 : least_vote;
    if (peak <= least) return score;
    const Tensor inside = score.masked_select(score > least);
    const double core = at::quantile(inside.to(at::kDouble), 0.9).item<double>();
    return (score * (0.5 / std::max(least, core_share * core))).clamp_max(1);
}

VoteGrid::VoteGrid(const FieldGeometry& geometry, int resolution) : geometry_(geometry), resolution_(resolution) {
    if (resolution < 2 || resolution > 512)
        throw std::invalid_argument(fmt::format("VoteGrid: resolution {}", resolution));
    votes_ = at::zeros({resolution, resolution, resolution});
    weight_ = at::zeros_like(votes_);
    colours_ = at::zeros({votes_.numel(), 3});
}

void VoteGrid::add(const Tensor& points, const Tensor& votes, const Tensor& weights, const Tensor& colours) {
    check_points(points);
    if (votes.sizes() != weights.sizes() || votes.dim() != 1 || votes.size(0) != points.size(0))
        throw std::invalid_argument("VoteGrid::add: votes and weights must be N, like the points");
    if (colours.dim() != 2 || colours.size(0) != points.size(0) || colours.size(1) != 3)
        throw std::invalid_argument("VoteGrid::add: colours must be N×3");
    const Tensor flat = cell_of(geometry_, resolution_, points);
    const Tensor kept = (flat >= 0).nonzero().squeeze(1);
    const Tensor index = flat.index_select(0, kept);
    const Tensor weight = weights.index_select(0, kept).to(at::kFloat);
    weight_.view(-1).index_add_(0, index, weight);
    colours_.index_add_(0, index, weight.unsqueeze(1) * colours.index_select(0, kept).to(at::kFloat));
    votes_.view(-1).index_add_(0, index, weight * votes.index_select(0, kept).to(at::kFloat));
}

VoteGrid::SeenCells VoteGrid::seen_cells() const {
    const Tensor cells = (weight_.view(-1) > least_weight).nonzero().squeeze(1);
    const std::int64_t count = cells.size(0);
    const Tensor colour = colours_.index_select(0, cells) / weight_.view(-1).index_select(0, cells).unsqueeze(1);
    // The place of each seen cell in `cells`, in a grid with a border; −1: not seen.
    const std::int64_t r = resolution_, wide = r + 2;
    Tensor place = at::full({wide * wide * wide}, -1, at::kLong);
    const Tensor z = cells.floor_divide(r * r), y = cells.floor_divide(r).remainder(r), x = cells.remainder(r);
    const Tensor bordered = ((z + 1) * wide + y + 1) * wide + x + 1;
    place.index_put_({bordered}, at::arange(count, at::kLong));
    std::vector<Tensor> neighbours, seen, apart;
    for (std::int64_t offset = 0; offset < 27; ++offset) {
        if (offset == 13) continue;
        const std::int64_t step = ((offset / 9 - 1) * wide + offset / 3 % 3 - 1) * wide + offset % 3 - 1;
        const Tensor next = place.index_select(0, bordered + step);
        neighbours.push_back(next.clamp_min(0));
        seen.push_back(next >= 0);
        apart.push_back((colour - colour.index_select(0, neighbours.back())).square().sum(1));
    }
    return {cells, at::stack(neighbours, 1), at::stack(seen, 1), at::stack(apart, 1)};
}

void VoteGrid::agree_by_colour(double tolerance, int rounds) {
    if (!(weight_ > least_weight).any().item<bool>()) return;
    const SeenCells around = seen_cells();
    const Tensor weight = weight_.view(-1).index_select(0, around.cells);
    const Tensor own = votes_.view(-1).index_select(0, around.cells) / weight;
    const Tensor index = around.neighbours.reshape(-1);
    const Tensor k = 2.0 * (around.apart * (-0.5 / (tolerance * tolerance))).exp() * around.seen;
    const Tensor total = 1 + k.sum(1);
    Tensor score = own;
    for (int round = 0; round < rounds; ++round)
        score = (own + (k * score.index_select(0, index).reshape(k.sizes())).sum(1)) / total;
    votes_.view(-1).index_put_({around.cells}, score * weight);
}

Tensor VoteGrid::grown_by_colour(const Tensor& cells, const Tensor& allowed, double tolerance) const {
    if (cells.sizes() != votes_.sizes() || allowed.sizes() != votes_.sizes())
        throw std::invalid_argument("VoteGrid::grown_by_colour: cells and allowed must be as large as the grid");
    Tensor grown = cells.to(at::kBool).clone();
    if (!(weight_ > least_weight).any().item<bool>()) return grown;
    const SeenCells around = seen_cells();
    const Tensor index = around.neighbours.reshape(-1);
    const Tensor alike = around.seen.logical_and(around.apart <= tolerance * tolerance);
    const Tensor may = allowed.reshape(-1).to(at::kBool).index_select(0, around.cells);
    Tensor marked = grown.view(-1).index_select(0, around.cells);
    for (bool changed = true; changed;) {
        const Tensor beside = marked.index_select(0, index).reshape(alike.sizes()).logical_and(alike).any(1);
        const Tensor next = marked.logical_or(beside.logical_and(may));
        changed = !at::equal(next, marked);
        marked = next;
    }
    grown.view(-1).index_put_({around.cells}, marked);
    return grown;
}

Tensor VoteGrid::score(int reach) const {
    Tensor known = (weight_ > least_weight).to(at::kFloat);
    Tensor score = votes_ / weight_.clamp_min(least_weight) * known;
    for (int layer = 0; layer < reach; ++layer) {
        const Tensor count = neighbourhood_sum(known);
        const Tensor fresh = (count > 0.5).logical_and(known < 0.5).to(at::kFloat);
        if (fresh.sum().item<float>() == 0) break;
        score = score + fresh * neighbourhood_sum(score * known) / count.clamp_min(1);
        known = known + fresh;
    }
    return score.clamp(0, 1);
}

}  // namespace fieldgraft
