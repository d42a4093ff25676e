#include "core/render/march.h"

#include <cmath>

#include "core/base/errors.h"
#include "core/base/shape.h"
#include "core/field/torch_parallel.h"
#include "core/kernels/march_ref.h"

namespace fieldgraft {
namespace {

constexpr std::int64_t rays_per_task = 256;
constexpr std::int64_t first_wave = 8, largest_wave = 64;  // samples of a ray looked at together

std::span<const float> floats(const Tensor& tensor) {
    return {tensor.const_data_ptr<float>(), static_cast<std::size_t>(tensor.numel())};
}

void check_rays(const RayBundle& rays) {
    for (const Tensor* part : {&rays.origins, &rays.directions}) {
        const bool fits = part->defined() && part->dim() == 2 && part->size(1) == 3 &&
                          part->size(0) == rays.origins.size(0) && part->scalar_type() == at::kFloat && part->is_cpu();
        if (!fits) throw std::invalid_argument("rays must be float32 R×3, not " + shape_text(*part));
    }
}

MarchGrid grid_of(const FieldGeometry& geometry, const Tensor& occupancy) {
    if (!occupancy.defined()) return make_march_grid(geometry.box_min, geometry.box_max, 0, {});
    if (occupancy.dim() != 3 || occupancy.scalar_type() != at::kByte || !occupancy.is_contiguous() ||
        occupancy.size(0) != occupancy.size(1) || occupancy.size(1) != occupancy.size(2)) {
        throw std::invalid_argument("occupancy must be a cube of bytes, not " + shape_text(occupancy));
    }
    return make_march_grid(geometry.box_min, geometry.box_max, static_cast<int>(occupancy.size(0)),
                           {occupancy.const_data_ptr<std::uint8_t>(), static_cast<std::size_t>(occupancy.numel())});
}

Tensor prefix_sums(const Tensor& counts) {
    Tensor start = at::zeros({counts.size(0) + 1}, at::kLong);
    if (counts.size(0) > 0) start.narrow(0, 1, counts.size(0)).copy_(counts.cumsum(0));
    return start;
}

Tensor draw_jitter(Random* random, std::int64_t rays) {
    if (random == nullptr) return {};
    Tensor jitter = at::empty({rays}, at::kFloat);
    float* values = jitter.mutable_data_ptr<float>();
    for (std::int64_t r = 0; r < rays; ++r) values[r] = random->uniform() - 0.5f;
    return jitter;
}

// The state of a march in depth waves: how far each ray has been looked at and what lies in front of that point.
struct Waves {
    const Samples& all;
    Tensor density;                     // N of the full march, written wave by wave
    Tensor features;                    // N×F
    std::vector<std::int64_t> reached;  // first sample of a ray that was not looked at
    std::vector<double> depth;          // optical depth in front of it
    std::vector<std::int64_t> visible;  // samples of a ray that can be seen
    std::vector<std::int64_t> active;   // rays that still see on
};

// Walks ray r's new samples [from, to): how many of them are visible, and whether light gets past them.
bool advance_ray(Waves& waves, std::int64_t r, std::int64_t from, std::int64_t to, double depth_limit) {
    const float *density = waves.density.const_data_ptr<float>(), *delta = waves.all.delta.const_data_ptr<float>();
    double depth = waves.depth[r];
    for (std::int64_t k = from; k < to; ++k) {
        if (depth > depth_limit) break;
        ++waves.visible[r];
        depth += std::min(static_cast<double>(density[k]) * delta[k], 1e30);
    }
    waves.depth[r] = depth;
    waves.reached[r] = to;
    return depth <= depth_limit;
}

// Evaluates the next `length` samples of every active ray, then keeps the rays that can see past them.
void advance(Waves& waves, const RadianceField& field, std::int64_t length, double depth_limit) {
    const std::int64_t* start = waves.all.start.const_data_ptr<std::int64_t>();
    const std::int64_t count = static_cast<std::int64_t>(waves.active.size());
    std::vector<std::int64_t> offset(count + 1, 0);
    for (std::int64_t i = 0; i < count; ++i) {
        const std::int64_t r = waves.active[i];
        offset[i + 1] = offset[i] + std::min(length, start[r + 1] - waves.reached[r]);
    }
    Tensor positions = at::empty({offset[count], 3}, at::kFloat);
    const float* source = waves.all.positions.const_data_ptr<float>();
    float* target = positions.mutable_data_ptr<float>();
    for (std::int64_t i = 0; i < count; ++i) {
        const float* from = source + 3 * waves.reached[waves.active[i]];
        std::copy(from, from + 3 * (offset[i + 1] - offset[i]), target + 3 * offset[i]);
    }
    const auto out = field.density(positions);
    const Tensor features = out.features.contiguous();
    const std::int64_t width = features.size(1);
    const float *density_in = out.density.const_data_ptr<float>(), *features_in = features.const_data_ptr<float>();
    float *density_out = waves.density.mutable_data_ptr<float>(),
          *features_out = waves.features.mutable_data_ptr<float>();
    std::vector<char> on(count);
    at::parallel_for(0, count, rays_per_task, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i) {
            const std::int64_t r = waves.active[i], from = waves.reached[r], n = offset[i + 1] - offset[i];
            std::copy(density_in + offset[i], density_in + offset[i + 1], density_out + from);
            std::copy(features_in + width * offset[i], features_in + width * offset[i + 1],
                      features_out + width * from);
            on[i] = advance_ray(waves, r, from, from + n, depth_limit) && from + n < start[r + 1];
        }
    });
    std::vector<std::int64_t> remaining;
    for (std::int64_t i = 0; i < count; ++i) {
        if (on[i]) remaining.push_back(waves.active[i]);
    }
    waves.active.swap(remaining);
}

// Row `index` of every tensor of the samples.
VisibleSamples select(const Waves& waves, const Tensor& start) {
    const std::int64_t* packed = start.const_data_ptr<std::int64_t>();
    const std::int64_t* full = waves.all.start.const_data_ptr<std::int64_t>();
    const std::int64_t rays = start.size(0) - 1;
    Tensor index = at::empty({packed[rays]}, at::kLong);
    std::int64_t* values = index.mutable_data_ptr<std::int64_t>();
    for (std::int64_t r = 0; r < rays; ++r) {
        for (std::int64_t k = packed[r]; k < packed[r + 1]; ++k) values[k] = full[r] + k - packed[r];
    }
    VisibleSamples out;
    out.samples.start = start;
    out.samples.ray = waves.all.ray.index_select(0, index);
    out.samples.positions = waves.all.positions.index_select(0, index);
    out.samples.t = waves.all.t.index_select(0, index);
    out.samples.delta = waves.all.delta.index_select(0, index);
    out.density = waves.density.index_select(0, index);
    out.features = waves.features.index_select(0, index);
    return out;
}

}  // namespace

double march_step(const FieldGeometry& geometry, const MarchOptions& options) {
    if (options.step < 0 || !std::isfinite(options.step)) {
        throw std::invalid_argument(fmt::format("the march's step must be positive, not {}", options.step));
    }
    if (options.step > 0) return options.step;
    double square = 0;
    for (int c = 0; c < 3; ++c) square += std::pow(geometry.box_max[c] - geometry.box_min[c], 2);
    return std::sqrt(square) / 1024;
}

Samples march(const FieldGeometry& geometry, const Tensor& occupancy, const RayBundle& rays,
              const MarchOptions& options) {
    check_rays(rays);
    const double step = march_step(geometry, options);
    const std::int64_t count = rays.size();
    const Tensor origins = rays.origins.contiguous(), directions = rays.directions.contiguous();
    const Tensor jitter = draw_jitter(options.jitter, count);
    const MarchGrid grid = grid_of(geometry, occupancy);
    const MarchRays packed{floats(origins), floats(directions),
                           jitter.defined() ? floats(jitter) : std::span<const float>(), step, options.near};
    Tensor counts = at::empty({count}, at::kLong);
    march_count(grid, packed, {counts.mutable_data_ptr<std::int64_t>(), static_cast<std::size_t>(count)},
                torch_parallel_for);
    Samples samples;
    samples.start = prefix_sums(counts);
    const std::int64_t total = samples.start[count].item<std::int64_t>();
    samples.ray = at::empty({total}, at::kLong);
    samples.positions = at::empty({total, 3}, at::kFloat);
    samples.t = at::empty({total}, at::kFloat);
    samples.delta = at::full({total}, step, at::kFloat);
    const auto size = static_cast<std::size_t>(total);
    march_fill(grid, packed, {samples.start.const_data_ptr<std::int64_t>(), static_cast<std::size_t>(count + 1)},
               {samples.ray.mutable_data_ptr<std::int64_t>(), size},
               {samples.positions.mutable_data_ptr<float>(), 3 * size}, {samples.t.mutable_data_ptr<float>(), size},
               torch_parallel_for);
    return samples;
}

VisibleSamples sample_visible(const RadianceField& field, const RayBundle& rays, const MarchOptions& options) {
    at::NoGradGuard no_grad;
    if (!(options.min_transmittance >= 0 && options.min_transmittance < 1)) {
        throw std::invalid_argument(
            fmt::format("min_transmittance must lie in [0, 1), not {}", options.min_transmittance));
    }
    const double depth_limit = -std::log(options.min_transmittance);  // infinite at 0: everything is visible
    const Samples all = march(field.geometry(), field.occupancy(), rays, options);
    const std::int64_t count = rays.size();
    Waves waves{all,
                at::empty({all.size()}, at::kFloat),
                at::empty({all.size(), field.config().feature_size}, at::kFloat),
                {},
                {},
                {},
                {}};
    const std::int64_t* start = all.start.const_data_ptr<std::int64_t>();
    waves.reached.assign(start, start + count);
    waves.depth.assign(count, 0.0);
    waves.visible.assign(count, 0);
    for (std::int64_t r = 0; r < count; ++r) {
        if (start[r] < start[r + 1]) waves.active.push_back(r);
    }
    for (std::int64_t length = first_wave; !waves.active.empty(); length = std::min(2 * length, largest_wave)) {
        advance(waves, field, length, depth_limit);
    }
    const Tensor visible = at::from_blob(waves.visible.data(), {count}, at::kLong);
    return select(waves, prefix_sums(visible));
}

Tensor union_of(const Tensor& occupancy_a, const Tensor& occupancy_b) {
    if (occupancy_a.sizes() != occupancy_b.sizes()) {
        throw std::invalid_argument("occupancies " + shape_text(occupancy_a) + " and " + shape_text(occupancy_b) +
                                    " differ in size");
    }
    return occupancy_a.ne(0).logical_or_(occupancy_b.ne(0)).to(at::kByte);
}

Tensor dilated(const Tensor& occupancy, int cells) {
    if (occupancy.dim() != 3)
        throw std::invalid_argument("occupancy must have three axes, not " + shape_text(occupancy));
    if (cells < 0) throw std::invalid_argument(fmt::format("cells to grow by must not be negative: {}", cells));
    Tensor grown = occupancy.ne(0).to(at::kByte);
    // A cube is the product of three segments: one axis after the other, one cell at a time.
    for (int axis = 0; axis < 3; ++axis) {
        const std::int64_t n = grown.size(axis);
        for (int i = 0; i < cells && n > 1; ++i) {
            const Tensor before = grown.clone();
            grown.narrow(axis, 1, n - 1).bitwise_or_(before.narrow(axis, 0, n - 1));
            grown.narrow(axis, 0, n - 1).bitwise_or_(before.narrow(axis, 1, n - 1));
        }
    }
    return grown;
}

}  // namespace fieldgraft
