#include "vdb_export/sampling.h"

#include <algorithm>
#include <cmath>

#include "core/base/errors.h"

namespace fieldgraft {
namespace {

using Range = std::array<std::int64_t, 2>;

void check(const SamplingOptions& options) {
    if (!(options.voxel > 0) || !std::isfinite(options.voxel)) {
        throw std::invalid_argument(fmt::format("voxel edge {}: it must be positive", options.voxel));
    }
    if (!(options.threshold >= 0)) {
        throw std::invalid_argument(fmt::format("threshold {}: it must not be negative", options.threshold));
    }
    if (options.supersample < 1 || options.supersample > 8) {
        throw std::invalid_argument(fmt::format("{} sub-samples an axis: 1 to 8 are possible", options.supersample));
    }
    if (!(options.max_optical_depth >= 0) || options.chunk_positions < 1) {
        throw std::invalid_argument(fmt::format("optical depth cap {} and chunk {} must not be negative",
                                                options.max_optical_depth, options.chunk_positions));
    }
}

// index (integer voxel centres) → user's world: the frame's inverse after box_min + (index + ½)·h.
std::array<double, 16> index_to_world(const FieldGeometry& geometry, double voxel) {
    const auto& f = geometry.frame;
    const double scale = frame_scale(geometry);
    std::array<double, 16> m{};
    m[15] = 1;
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column) {
            const double inverse = f[4 * column + row] / (scale * scale);  // (s R)⁻¹ = Rᵀ / s = (s R)ᵀ / s²
            m[4 * row + column] = inverse * voxel;
            m[4 * row + 3] += inverse * (geometry.box_min[column] + 0.5 * voxel - f[4 * column + 3]);
        }
    }
    return m;
}

// The cells [first, last] of an R-cell axis that a block of voxels touches.
Range cells_of_block(std::int64_t block, std::int64_t voxels, double voxel, double edge, std::int64_t cells) {
    const double low = static_cast<double>(block * block_edge) * voxel / edge * static_cast<double>(cells);
    const double high =
        static_cast<double>(std::min((block + 1) * block_edge, voxels)) * voxel / edge * static_cast<double>(cells);
    const auto first = static_cast<std::int64_t>(std::floor(low));
    const auto last = static_cast<std::int64_t>(std::ceil(high)) - 1;
    return {std::clamp<std::int64_t>(first, 0, cells - 1), std::clamp<std::int64_t>(last, 0, cells - 1)};
}

bool any_occupied(const Tensor& grid, const std::array<Range, 3>& cells) {
    const std::int64_t r = grid.size(0);
    const std::uint8_t* data = grid.data_ptr<std::uint8_t>();
    for (std::int64_t z = cells[2][0]; z <= cells[2][1]; ++z) {
        for (std::int64_t y = cells[1][0]; y <= cells[1][1]; ++y) {
            const std::uint8_t* row = data + (z * r + y) * r;
            if (std::any_of(row + cells[0][0], row + cells[0][1] + 1, [](std::uint8_t v) { return v != 0; }))
                return true;
        }
    }
    return false;
}

// Origins (B×3 int32) of the blocks that touch an occupied cell.
Tensor candidate_blocks(const FieldGeometry& geometry, const std::vector<Tensor>& occupancy, double voxel) {
    std::vector<Tensor> grids;
    for (const Tensor& grid : occupancy) {
        if (grid.dim() != 3 || grid.dtype() != at::kByte || grid.size(1) != grid.size(0) ||
            grid.size(2) != grid.size(0)) {
            throw std::invalid_argument(
                fmt::format("occupancy grid of {} dimensions: R×R×R uint8 is needed", grid.dim()));
        }
        grids.push_back(grid.contiguous());
    }
    const auto voxels = voxel_counts(geometry, voxel);
    const auto blocks = [&](int axis) { return (voxels[axis] + block_edge - 1) / block_edge; };
    const auto touches = [&](const Tensor& grid, const std::array<std::int64_t, 3>& block) {
        std::array<Range, 3> cells;
        for (int a = 0; a < 3; ++a) {
            const double edge = geometry.box_max[a] - geometry.box_min[a];
            cells[a] = cells_of_block(block[a], voxels[a], voxel, edge, grid.size(0));
        }
        return any_occupied(grid, cells);
    };
    std::vector<int> origins;
    for (std::int64_t x = 0; x < blocks(0); ++x) {
        for (std::int64_t y = 0; y < blocks(1); ++y) {
            for (std::int64_t z = 0; z < blocks(2); ++z) {
                const bool wanted = grids.empty() || std::any_of(grids.begin(), grids.end(), [&](const Tensor& grid) {
                                        return touches(grid, {x, y, z});
                                    });
                if (!wanted) continue;
                for (const std::int64_t v : {x, y, z}) origins.push_back(static_cast<int>(v) * block_edge);
            }
        }
    }
    return torch::tensor(origins, at::kInt).view({-1, 3});
}

// 512×3 float: a block's voxel offsets in leaf order.
Tensor voxel_offsets() {
    const Tensor line = at::arange(block_edge, at::kFloat);
    const auto axes = at::meshgrid({line, line, line}, "ij");
    return at::stack({axes[0], axes[1], axes[2]}, -1).reshape({block_voxels, 3});
}

// s³×3 float: sub-sample offsets from a voxel's centre, in voxels.
Tensor sub_sample_offsets(int s) {
    const Tensor line = (at::arange(s, at::kFloat) + 0.5) / s - 0.5;
    const auto axes = at::meshgrid({line, line, line}, "ij");
    return at::stack({axes[0], axes[1], axes[2]}, -1).reshape({-1, 3});
}

class BlockSampler {
  public:
    BlockSampler(const FieldGeometry& geometry, const VolumeSource& medium, const SamplingOptions& options)
        : medium_(medium), options_(options), offsets_(voxel_offsets()), sub_(sub_sample_offsets(options.supersample)) {
        std::array<float, 3> low{}, high{};
        for (int a = 0; a < 3; ++a) {
            low[a] = static_cast<float>(geometry.box_min[a]);
            high[a] = static_cast<float>(geometry.box_max[a]);
        }
        box_min_ = torch::tensor({low[0], low[1], low[2]});
        box_max_ = torch::tensor({high[0], high[1], high[2]});
    }

    struct Block {
        Tensor origins, density, color;  // B×3, B×512 (model units), B×512×3; only blocks that hold something
    };

    // origins B×3 int32.
    Block sample(const Tensor& origins) const {
        const Tensor centres = centres_of(origins).reshape({-1, 3});
        const Tensor first = (capped_density(centres).view({-1, block_voxels}) * options_.voxel).amax(1);
        // A tenth of the threshold: what a block's centres miss, its sub-samples may still catch.
        const Tensor wanted = (first > 0.1 * options_.threshold).nonzero().squeeze(1);
        const Tensor kept = origins.index_select(0, wanted);
        auto [density, position] = averaged(centres_of(kept).reshape({-1, 3}));
        const Tensor active = (density * options_.voxel > options_.threshold).logical_and(density > 0);
        density = at::where(active, density, at::zeros_like(density));
        Tensor color = at::zeros({density.size(0), 3}, at::kFloat);
        const Tensor where = active.nonzero().squeeze(1);
        if (where.size(0) > 0) color.index_copy_(0, where, colors(position.index_select(0, where)));
        const Tensor full = active.view({-1, block_voxels}).any(1).nonzero().squeeze(1);
        return {kept.index_select(0, full), density.view({-1, block_voxels}).index_select(0, full),
                color.view({-1, block_voxels, 3}).index_select(0, full)};
    }

  private:
    Tensor centres_of(const Tensor& origins) const {
        const Tensor index = origins.to(at::kFloat).unsqueeze(1) + offsets_.unsqueeze(0) + 0.5;
        return box_min_ + index * options_.voxel;
    }

    // 0 outside the box: the last blocks reach over its edge.
    Tensor capped_density(const Tensor& positions) const {
        Tensor density = medium_.density(positions);
        const Tensor inside = (positions >= box_min_).logical_and(positions <= box_max_).all(1);
        density = at::where(inside, density, at::zeros_like(density));
        return options_.max_optical_depth > 0 ? density.clamp_max(options_.max_optical_depth / options_.voxel)
                                              : density;
    }

    // Mean density over the sub-samples, and their density-weighted centre.
    std::pair<Tensor, Tensor> averaged(const Tensor& centres) const {
        const std::int64_t n = centres.size(0), s = sub_.size(0);
        Tensor density = at::empty({n}, at::kFloat), position = at::empty({n, 3}, at::kFloat);
        const std::int64_t step = std::max<std::int64_t>(1, options_.chunk_positions / s);
        for (std::int64_t first = 0; first < n; first += step) {
            const std::int64_t count = std::min(step, n - first);
            const Tensor around = centres.narrow(0, first, count).unsqueeze(1) + sub_.unsqueeze(0) * options_.voxel;
            const Tensor sigma = capped_density(around.reshape({-1, 3})).view({count, s});
            const Tensor weight = sigma / sigma.sum(1, true).clamp_min(1e-30);
            density.narrow(0, first, count).copy_(sigma.mean(1));
            position.narrow(0, first, count).copy_((weight.unsqueeze(-1) * around).sum(1));
        }
        return {density, position};
    }

    Tensor colors(const Tensor& positions) const {
        const std::int64_t n = positions.size(0), step = std::max<std::int64_t>(1, options_.chunk_positions / 16);
        Tensor color = at::empty({n, 3}, at::kFloat);
        for (std::int64_t first = 0; first < n; first += step) {
            const std::int64_t count = std::min(step, n - first);
            color.narrow(0, first, count).copy_(medium_.color(positions.narrow(0, first, count)));
        }
        return color;
    }

    const VolumeSource& medium_;
    const SamplingOptions& options_;
    Tensor offsets_, sub_, box_min_, box_max_;
};

}  // namespace

double frame_scale(const FieldGeometry& geometry) {
    const auto& f = geometry.frame;
    double gram[3][3] = {};
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            for (int row = 0; row < 3; ++row) gram[i][j] += f[4 * row + i] * f[4 * row + j];
        }
    }
    const double square = (gram[0][0] + gram[1][1] + gram[2][2]) / 3;
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            const bool right = square > 0 && std::abs(gram[i][j] - (i == j ? square : 0)) <= 1e-4 * square;
            if (!right)
                throw std::invalid_argument(
                    "the field's frame is not a rotation with one scale: it cannot be inverted");
        }
    }
    return std::sqrt(square);
}

std::array<std::int64_t, 3> voxel_counts(const FieldGeometry& geometry, double voxel) {
    std::array<std::int64_t, 3> counts{};
    for (int a = 0; a < 3; ++a) {
        const double edge = geometry.box_max[a] - geometry.box_min[a];
        counts[a] = std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(edge / voxel - 1e-6)));
    }
    return counts;
}

SparseVolume sample_volume(const FieldGeometry& geometry, const VolumeSource& medium, const SamplingOptions& options,
                           const Reporter& reporter) {
    check(options);
    at::NoGradGuard no_grad;
    const double scale = frame_scale(geometry);
    const Tensor candidates = candidate_blocks(geometry, medium.occupancy, options.voxel);
    const BlockSampler sampler(geometry, medium, options);
    const std::int64_t total = candidates.size(0),
                       step = std::max<std::int64_t>(1, options.chunk_positions / block_voxels);
    const Stopwatch watch;
    std::vector<Tensor> origins, density, color;
    for (std::int64_t first = 0; first < total; first += step) {
        if (reporter.stop_requested()) throw Cancelled();
        const std::int64_t count = std::min(step, total - first);
        const auto block = sampler.sample(candidates.narrow(0, first, count));
        origins.push_back(block.origins);
        density.push_back(block.density * scale);
        color.push_back(block.color);
        const double done = static_cast<double>(first + count), left = static_cast<double>(total) - done;
        reporter.event({{"event", "progress"},
                        {"iteration", first + count},
                        {"total", total},
                        {"eta_s", watch.seconds() / done * left}});
    }
    SparseVolume volume;
    volume.origins = origins.empty() ? at::empty({0, 3}, at::kInt) : at::cat(origins);
    volume.density = density.empty() ? at::empty({0, block_voxels}, at::kFloat) : at::cat(density);
    volume.color = color.empty() ? at::empty({0, block_voxels, 3}, at::kFloat) : at::cat(color);
    volume.index_to_world = index_to_world(geometry, options.voxel);
    return volume;
}

}  // namespace fieldgraft
