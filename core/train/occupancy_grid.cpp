#include "core/train/occupancy_grid.h"

#include <numeric>

#include "core/base/errors.h"
#include "core/base/shape.h"

namespace fieldgraft {
namespace {

constexpr float decay = 0.9f;
constexpr std::int64_t turns = 32;       // of refresh_some until every cell was looked into
constexpr std::int64_t batch = 1 << 18;  // points evaluated at once: bounds the memory

}  // namespace

OccupancyGrid::OccupancyGrid(const FieldGeometry& geometry, int resolution, double step)
    : geometry_(geometry), resolution_(resolution), threshold_(0.01 / step) {
    if (resolution < 1 || resolution > 1024 || !(step > 0)) {
        throw std::invalid_argument(
            fmt::format("occupancy: resolution {} and step {} are not usable", resolution, step));
    }
    // Nothing is known to be empty at first: above any limit.
    values_ = at::full({resolution_, resolution_, resolution_}, 2 * threshold_, at::kFloat);
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
    std::vector<std::int64_t> cells(values_.numel());
    std::iota(cells.begin(), cells.end(), 0);
    // What was never looked at is not remembered: the first look starts the record.
    if (turn_ == 0) values_.zero_();
    look_into(field, cells, random);
    ++turn_;
}

void OccupancyGrid::refresh_some(const RadianceField& field, Random& random) {
    std::vector<std::int64_t> cells, occupied;
    const std::int64_t total = values_.numel();
    // Consecutive turns take cells far from each other, so that every part of the box is seen to now and then.
    for (std::int64_t cell = turn_ % turns; cell < total; cell += turns) cells.push_back(cell);
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
    return values_.gt(limit()).to(at::kByte);
}

double OccupancyGrid::share() const {
    return values_.gt(limit()).to(at::kFloat).mean().item<double>();
}

void OccupancyGrid::restore(const Tensor& values, std::int64_t turn) {
    if (values.sizes() != values_.sizes() || values.scalar_type() != at::kFloat) {
        throw std::invalid_argument("occupancy: cannot restore from " + shape_text(values));
    }
    values_ = values.clone();
    turn_ = turn;
}

}  // namespace fieldgraft
