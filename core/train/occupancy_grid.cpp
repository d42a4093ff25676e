#include "core/train/occupancy_grid.h"

#include <numeric>

#include "core/base/errors.h"
#include "core/base/shape.h"
#include "core/field/torch_parallel.h"

namespace fieldgraft {
namespace {

constexpr float decay = 0.9f;
constexpr std::int64_t turns = 32;       // of refresh_some until every cell was looked into
constexpr std::int64_t batch = 1 << 18;  // points evaluated at once: bounds the memory

}  // namespace

namespace {

constexpr int block_cells = 4;  // along an edge, judged together by seen_cells

// What a camera sees, for a quick look: all directions up to the angle of the furthest corner or edge of its picture.
struct ViewCone {
    Vec3 apex, axis;
    double angle;

    explicit ViewCone(const Camera& camera) : apex(camera.position()), axis(camera.forward()) {
        const std::int64_t w = camera.width - 1, h = camera.height - 1;
        const Tensor pixels = torch::tensor({0l, 0l, w, 0l, 0l, h, w, h, w / 2, 0l, 0l, h / 2, w, h / 2, w / 2, h});
        const Tensor directions = rays_through_pixels(camera, pixels.view({-1, 2})).directions;
        const Tensor cosines = directions.matmul(torch::tensor({axis[0], axis[1], axis[2]}, at::kFloat));
        // Half a pixel more than the outermost centres.
        angle = std::acos(std::clamp(cosines.min().item<double>(), -1.0, 1.0)) * 1.02 + 1e-3;
    }

    bool sees(const Vec3& centre, double radius, double near) const {
        const Vec3 way{centre[0] - apex[0], centre[1] - apex[1], centre[2] - apex[2]};
        const double distance = std::sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2]);
        if (distance + radius <= near) return false;
        if (distance <= radius) return true;
        const double along = (way[0] * axis[0] + way[1] * axis[1] + way[2] * axis[2]) / distance;
        return std::acos(std::clamp(along, -1.0, 1.0)) <= angle + std::asin(radius / distance);
    }
};

}  // namespace

Tensor seen_cells(const FieldGeometry& geometry, int resolution, const std::vector<Camera>& cameras, double near) {
    const std::vector<ViewCone> cones(cameras.begin(), cameras.end());
    const std::int64_t n = resolution, blocks = (n + block_cells - 1) / block_cells;
    Tensor seen = at::zeros({n, n, n}, at::kBool);
    bool* out = seen.mutable_data_ptr<bool>();
    double width[3], radius = 0;
    for (int c = 0; c < 3; ++c) {
        width[c] = (geometry.box_max[c] - geometry.box_min[c]) / static_cast<double>(n);
        radius += std::pow(0.5 * block_cells * width[c], 2);
    }
    radius = std::sqrt(radius);
    share_out(blocks * blocks * blocks, [&](std::int64_t block) {
        const std::int64_t first[3] = {block % blocks * block_cells, block / blocks % blocks * block_cells,
                                       block / (blocks * blocks) * block_cells};
        Vec3 centre;
        for (int c = 0; c < 3; ++c) {
            centre[c] = geometry.box_min[c] + (static_cast<double>(first[c]) + 0.5 * block_cells) * width[c];
        }
        const auto sees = [&](const ViewCone& cone) { return cone.sees(centre, radius, near); };
        if (std::none_of(cones.begin(), cones.end(), sees)) return;
        for (std::int64_t z = first[2]; z < std::min(first[2] + block_cells, n); ++z) {
            for (std::int64_t y = first[1]; y < std::min(first[1] + block_cells, n); ++y) {
                const std::int64_t row = (z * n + y) * n;
                std::fill(out + row + first[0], out + row + std::min(first[0] + block_cells, n), true);
            }
        }
    });
    return seen;
}

OccupancyGrid::OccupancyGrid(const FieldGeometry& geometry, int resolution, double step, const Tensor& seen)
    : geometry_(geometry), resolution_(resolution), threshold_(0.01 / step), seen_(seen) {
    if (resolution < 1 || resolution > 1024 || !(step > 0)) {
        throw std::invalid_argument(
            fmt::format("occupancy: resolution {} and step {} are not usable", resolution, step));
    }
    // Nothing is known to be empty at first: above any limit.
    values_ = at::full({resolution_, resolution_, resolution_}, 2 * threshold_, at::kFloat);
    if (!seen_.defined()) seen_ = at::ones_like(values_, at::kBool);
    if (seen_.sizes() != values_.sizes()) {
        throw std::invalid_argument(fmt::format("occupancy: {} for {}³ cells", shape_text(seen_), resolution));
    }
    values_.masked_fill_(seen_.logical_not(), 0);
}

void OccupancyGrid::look_into(const RadianceField& field, const std::vector<std::int64_t>& cells, Random& random) {
    at::NoGradGuard no_grad;
    float* values = values_.mutable_data_ptr<float>();
    const std::int64_t count = static_cast<std::int64_t>(cells.size());
    for (std::int64_t first = 0; first < count; first += batch) {
        const std::int64_t n = std::min(batch, count - first);
        Tensor positions = at::empty({n, 3}, at::kFloat);
        float* out = positions.mutable_data_ptr<float>();
        for (std::int64_t i = 0; i < n; ++i) {
            std::int64_t cell = cells[first + i];
            for (int c = 0; c < 3; ++c, cell /= resolution_) {
                const double width = (geometry_.box_max[c] - geometry_.box_min[c]) / static_cast<double>(resolution_);
                const double place = static_cast<double>(cell % resolution_) + random.uniform();
                out[3 * i + c] = static_cast<float>(geometry_.box_min[c] + place * width);
            }
        }
        const Tensor density = field.density(positions).density;
        const float* found = density.const_data_ptr<float>();
        for (std::int64_t i = 0; i < n; ++i) {
            float& value = values[cells[first + i]];
            value = std::max(decay * value, found[i]);
        }
    }
}

void OccupancyGrid::refresh_all(const RadianceField& field, Random& random) {
    std::vector<std::int64_t> cells;
    const bool* seen = seen_.const_data_ptr<bool>();
    for (std::int64_t cell = 0; cell < values_.numel(); ++cell) {
        if (seen[cell]) cells.push_back(cell);
    }
    // What was never looked at is not remembered: the first look starts the record.
    if (turn_ == 0) values_.zero_();
    look_into(field, cells, random);
    ++turn_;
}

void OccupancyGrid::refresh_some(const RadianceField& field, Random& random) {
    std::vector<std::int64_t> cells, occupied;
    const std::int64_t total = values_.numel();
    // Consecutive turns take cells far from each other, so that every part of the box is seen to now and then.
    const bool* seen = seen_.const_data_ptr<bool>();
    for (std::int64_t cell = turn_ % turns; cell < total; cell += turns) {
        if (seen[cell]) cells.push_back(cell);
    }
    const float* values = values_.const_data_ptr<float>();
    const float bound = limit();
    for (std::int64_t cell = 0; cell < total; ++cell) {
        if (values[cell] > bound) occupied.push_back(cell);
    }
    const std::size_t more = occupied.empty() ? 0 : cells.size();
    for (std::size_t i = 0; i < more; ++i) {
        cells.push_back(occupied[random.below(static_cast<std::uint32_t>(occupied.size()))]);
    }
    look_into(field, cells, random);
    ++turn_;
}

float OccupancyGrid::limit() const {
    // Well below the mean: where all cells are alike, all are occupied, not those that rounding favours. Summed in
    // order, so that the number of threads does not show.
    const float* values = values_.const_data_ptr<float>();
    const double mean = std::accumulate(values, values + values_.numel(), 0.0) / static_cast<double>(values_.numel());
    return static_cast<float>(std::min(0.9 * mean, threshold_));
}

Tensor OccupancyGrid::cells() const {
    return values_.gt(limit()).to(at::kByte);  // of cells that are not seen the value stays 0
}

double OccupancyGrid::share() const {
    return cells().to(at::kFloat).mean().item<double>();
}

void OccupancyGrid::restore(const Tensor& values, std::int64_t turn) {
    if (values.sizes() != values_.sizes() || values.scalar_type() != at::kFloat) {
        throw std::invalid_argument("occupancy: cannot restore from " + shape_text(values));
    }
    values_ = values.clone();
    turn_ = turn;
}

}  // namespace fieldgraft
