#include "core/render/march.h"

#include <cmath>

#include "core/base/errors.h"
#include "core/base/shape.h"
#include "core/base/spans.h"
#include "core/field/cells.h"
#include "core/field/kernel_field.h"
#include "core/field/torch_parallel.h"

namespace fieldgraft {
namespace {

constexpr std::int64_t rays_per_march = 256;
constexpr std::int64_t first_wave = 8, largest_wave = 64;  // samples of a ray looked at together

Tensor prefix_sums(const Tensor& counts) {
    Tensor start = at::zeros({counts.size(0) + 1}, at::kLong);
    if (counts.size(0) > 0) start.narrow(0, 1, counts.size(0)).copy_(counts.cumsum(0));
    return start;
}

// What one wave found: for its i-th ray samples offset[i] … offset[i + 1]−1 of density and features.
struct Wave {
    std::vector<std::int64_t> rays, offset;
    Tensor density, features;
};

// All samples of a march through f's cells and others, and which of them lie in f's.
struct Marched {
    Samples all;
    Tensor occupied;  // N bool; undefined: all
};

// Joins runs of `stride` steps outside f's cells, counted from the camera, into one sample each.
Marched joined_empty_steps(const Marched& marched, double near, double step, int stride) {
    const Samples& all = marched.all;
    const std::int64_t rays = all.start.size(0) - 1;
    const std::int64_t* from = all.start.const_data_ptr<std::int64_t>();
    const float* t = all.t.const_data_ptr<float>();
    const bool* occupied = marched.occupied.const_data_ptr<bool>();
    // Steps from k on that become one sample: stride or 1.
    const auto run = [&](std::int64_t k, std::int64_t end) -> std::int64_t {
        const auto group = [&](std::int64_t i) { return static_cast<std::int64_t>((t[i] - near) / step) / stride; };
        if (occupied[k] || k + stride > end) return 1;
        for (std::int64_t i = k; i < k + stride; ++i) {
            if (occupied[i] || group(i) != group(k)) return 1;
        }
        return stride;
    };
    Tensor counts = at::zeros({rays}, at::kLong);
    std::int64_t* count = counts.mutable_data_ptr<std::int64_t>();
    at::parallel_for(0, rays, rays_per_march, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t r = begin; r < end; ++r) {
            for (std::int64_t k = from[r]; k < from[r + 1]; k += run(k, from[r + 1])) ++count[r];
        }
    });
    Marched out;
    out.all.start = prefix_sums(counts);
    const std::int64_t* to = out.all.start.const_data_ptr<std::int64_t>();
    const std::int64_t total = to[rays];
    out.all.ray = at::empty({total}, at::kLong);
    out.all.positions = at::empty({total, 3}, at::kFloat);
    out.all.t = at::empty({total}, at::kFloat);
    out.all.delta = at::empty({total}, at::kFloat);
    out.occupied = at::empty({total}, at::kBool);
    const float *positions = all.positions.const_data_ptr<float>(), *delta = all.delta.const_data_ptr<float>();
    at::parallel_for(0, rays, rays_per_march, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t r = begin; r < end; ++r) {
            std::int64_t i = to[r];
            for (std::int64_t k = from[r], n; k < from[r + 1]; k += n, ++i) {
                n = run(k, from[r + 1]);
                const std::int64_t last = k + n - 1;
                out.all.ray.mutable_data_ptr<std::int64_t>()[i] = r;
                out.all.t.mutable_data_ptr<float>()[i] = 0.5f * (t[k] + t[last]);
                out.all.delta.mutable_data_ptr<float>()[i] = static_cast<float>(n) * delta[k];
                for (int c = 0; c < 3; ++c) {
                    out.all.positions.mutable_data_ptr<float>()[3 * i + c] =
                        0.5f * (positions[3 * k + c] + positions[3 * last + c]);
                }
                out.occupied.mutable_data_ptr<bool>()[i] = occupied[k];
            }
        }
    });
    return out;
}

Marched march_with(const RadianceField& field, const RayBundle& rays, const MarchOptions& options,
                   const EditCells& cells) {
    const Tensor& own = field.occupancy();
    if (!cells.extra.defined() || !own.defined()) return {march(field.geometry(), own, rays, options), {}};
    const bool everywhere = cells.extra.ne(0).all().item<bool>();
    const Tensor visited =
        everywhere ? Tensor() : union_of(own, resampled_cells(cells.extra, static_cast<int>(own.size(0))));
    Marched marched{march(field.geometry(), visited, rays, options), {}};
    marched.occupied = in_cells(field.geometry(), own, marched.all.positions);
    if (cells.extra_stride == 1) return marched;
    return joined_empty_steps(marched, options.near, march_step(field.geometry(), options), cells.extra_stride);
}

// The state of a march in depth waves: how far each ray has been looked at and what lies in front of that point.
struct Front {
    const Marched& marched;
    Tensor transparent;
    const Samples& all;
    double depth_limit;
    std::vector<std::int64_t> reached;  // first sample of a ray that was not looked at
    std::vector<double> depth;          // optical depth in front of it
    std::vector<std::int64_t> visible;  // samples of a ray that can be seen
    std::vector<std::int64_t> active;   // rays that still see on
};

// Walks ray r's n new samples: how many of them are visible, and whether the ray goes on past them. density: of what
// hides.
bool advance_ray(Front& front, std::int64_t r, std::int64_t n, const float* density) {
    const float* delta = front.all.delta.const_data_ptr<float>() + front.reached[r];
    double depth = front.depth[r];
    for (std::int64_t k = 0; k < n && depth <= front.depth_limit; ++k) {
        ++front.visible[r];
        depth += std::min(static_cast<double>(density[k]) * delta[k], 1e30);
    }
    front.depth[r] = depth;
    front.reached[r] += n;
    return depth <= front.depth_limit && front.reached[r] < front.all.start.const_data_ptr<std::int64_t>()[r + 1];
}

// f's density and features at the positions; 0 at those that `occupied` (bytes, undefined: all are) does not mark.
std::pair<Tensor, Tensor> own_density(const RadianceField& field, const Tensor& positions, const Tensor& occupied) {
    const Tensor rows = occupied.defined() ? occupied.nonzero().squeeze(1) : Tensor();
    if (!rows.defined() || rows.size(0) == positions.size(0)) {
        const auto out = field.density(positions);
        return {out.density, out.features.contiguous()};
    }
    const auto part = field.density(positions.index_select(0, rows));
    Tensor density = at::zeros({positions.size(0)}, at::kFloat);
    Tensor features = at::zeros({positions.size(0), part.features.size(1)}, at::kFloat);
    return {density.index_copy_(0, rows, part.density), features.index_copy_(0, rows, part.features)};
}

// Evaluates the next `length` samples of every active ray, then keeps the rays that can see past them.
Wave advance(Front& front, const RadianceField& field, std::int64_t length) {
    const std::int64_t* start = front.all.start.const_data_ptr<std::int64_t>();
    const std::int64_t count = static_cast<std::int64_t>(front.active.size());
    Wave wave{front.active, std::vector<std::int64_t>(count + 1, 0), {}, {}};
    for (std::int64_t i = 0; i < count; ++i) {
        const std::int64_t r = wave.rays[i];
        wave.offset[i + 1] = wave.offset[i] + std::min(length, start[r + 1] - front.reached[r]);
    }
    const bool mixed = front.marched.occupied.defined();
    Tensor positions = at::empty({wave.offset[count], 3}, at::kFloat);
    Tensor occupied = mixed ? at::empty({wave.offset[count]}, at::kBool) : Tensor();
    const float* source = front.all.positions.const_data_ptr<float>();
    float* target = positions.mutable_data_ptr<float>();
    at::parallel_for(0, count, rays_per_march, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i) {
            const std::int64_t first = front.reached[wave.rays[i]], n = wave.offset[i + 1] - wave.offset[i];
            std::copy_n(source + 3 * first, 3 * n, target + 3 * wave.offset[i]);
            if (!mixed) continue;
            const bool* marks = front.marched.occupied.const_data_ptr<bool>() + first;
            std::copy_n(marks, n, occupied.mutable_data_ptr<bool>() + wave.offset[i]);
        }
    });
    std::tie(wave.density, wave.features) = own_density(field, positions, occupied);
    Tensor hiding = wave.density;
    if (front.transparent.defined())
        hiding = hiding * in_cells(field.geometry(), front.transparent, positions).logical_not();
    const float* density = hiding.const_data_ptr<float>();
    std::vector<char> on(count);
    at::parallel_for(0, count, rays_per_march, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i) {
            const std::int64_t first = wave.offset[i];
            on[i] = advance_ray(front, wave.rays[i], wave.offset[i + 1] - first, density + first);
        }
    });
    front.active.clear();
    for (std::int64_t i = 0; i < count; ++i) {
        if (on[i]) front.active.push_back(wave.rays[i]);
    }
    return wave;
}

// The first visible[r] samples of every ray r of the full march.
Samples first_samples(const Samples& all, const Tensor& start) {
    const std::int64_t rays = start.size(0) - 1;
    const std::int64_t *to = start.const_data_ptr<std::int64_t>(), *from = all.start.const_data_ptr<std::int64_t>();
    const std::int64_t total = to[rays];
    Samples out{start, at::empty({total}, at::kLong), at::empty({total, 3}, at::kFloat), at::empty({total}, at::kFloat),
                at::empty({total}, at::kFloat)};
    at::parallel_for(0, rays, rays_per_march, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t r = begin; r < end; ++r) {
            const std::int64_t n = to[r + 1] - to[r];
            const auto copy = [&](const Tensor& source, const Tensor& target, std::int64_t width) {
                const float* values = source.const_data_ptr<float>() + width * from[r];
                std::copy(values, values + width * n, target.mutable_data_ptr<float>() + width * to[r]);
            };
            std::fill_n(out.ray.mutable_data_ptr<std::int64_t>() + to[r], n, r);
            copy(all.positions, out.positions, 3);
            copy(all.t, out.t, 1);
            copy(all.delta, out.delta, 1);
        }
    });
    return out;
}

// Brings what the waves found into the packed order, as far as it is visible.
void gather(const std::vector<Wave>& waves, const Front& front, std::int64_t width, VisibleSamples& out) {
    const std::int64_t* start = out.samples.start.const_data_ptr<std::int64_t>();
    const std::int64_t total = out.samples.size();
    out.density = at::empty({total}, at::kFloat);
    out.features = at::empty({total, width}, at::kFloat);
    float *density = out.density.mutable_data_ptr<float>(), *features = out.features.mutable_data_ptr<float>();
    std::vector<std::int64_t> done(front.visible.size(), 0);
    for (const Wave& wave : waves) {
        const float *density_in = wave.density.const_data_ptr<float>(),
                    *features_in = wave.features.const_data_ptr<float>();
        at::parallel_for(0, static_cast<std::int64_t>(wave.rays.size()), rays_per_march,
                         [&](std::int64_t begin, std::int64_t end) {
                             for (std::int64_t i = begin; i < end; ++i) {
                                 const std::int64_t r = wave.rays[i], from = wave.offset[i], to = start[r] + done[r];
                                 const std::int64_t n = std::min(wave.offset[i + 1] - from, front.visible[r] - done[r]);
                                 std::copy_n(density_in + from, n, density + to);
                                 std::copy_n(features_in + width * from, width * n, features + width * to);
                                 done[r] += n;
                             }
                         });
    }
}

}  // namespace

void check_rays(const RayBundle& rays) {
    for (const Tensor* part : {&rays.origins, &rays.directions}) {
        const bool fits = part->defined() && part->dim() == 2 && part->size(1) == 3 &&
                          part->size(0) == rays.origins.size(0) && part->scalar_type() == at::kFloat && part->is_cpu();
        if (!fits) throw std::invalid_argument("rays must be float32 R×3, not " + shape_text(*part));
    }
}

void check_transmittance(const MarchOptions& options) {
    if (!(options.min_transmittance >= 0 && options.min_transmittance < 1)) {
        throw std::invalid_argument(
            fmt::format("min_transmittance must lie in [0, 1), not {}", options.min_transmittance));
    }
}

Tensor draw_jitter(Random* random, std::int64_t rays) {
    if (random == nullptr) return {};
    Tensor jitter = at::empty({rays}, at::kFloat);
    float* values = jitter.mutable_data_ptr<float>();
    for (std::int64_t r = 0; r < rays; ++r) values[r] = random->uniform() - 0.5f;
    return jitter;
}

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
    const MarchGrid grid = march_grid_of(geometry, occupancy);
    const MarchRays packed{values(origins), values(directions),
                           jitter.defined() ? values(jitter) : std::span<const float>(), step, options.near};
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

VisibleSamples sample_visible(const RadianceField& field, const RayBundle& rays, const MarchOptions& options,
                              const EditCells& cells) {
    at::NoGradGuard no_grad;
    check_transmittance(options);
    if (cells.extra_stride < 1) throw std::invalid_argument("extra_stride must be at least 1");
    const double depth_limit = -std::log(options.min_transmittance);  // infinite at 0: everything is visible
    const Marched marched = march_with(field, rays, options, cells);
    const Samples& all = marched.all;
    const std::int64_t count = rays.size();
    Front front{marched,
                cells.transparent,
                all,
                depth_limit,
                {},
                std::vector<double>(count, 0.0),
                std::vector<std::int64_t>(count, 0),
                {}};
    const std::int64_t* start = all.start.const_data_ptr<std::int64_t>();
    front.reached.assign(start, start + count);
    for (std::int64_t r = 0; r < count; ++r) {
        if (start[r] < start[r + 1]) front.active.push_back(r);
    }
    std::vector<Wave> waves;
    for (std::int64_t length = first_wave; !front.active.empty(); length = std::min(2 * length, largest_wave)) {
        waves.push_back(advance(front, field, length));
    }
    VisibleSamples out;
    out.samples = first_samples(all, prefix_sums(at::from_blob(front.visible.data(), {count}, at::kLong)));
    gather(waves, front, field.config().feature_size, out);
    return out;
}

}  // namespace fieldgraft
