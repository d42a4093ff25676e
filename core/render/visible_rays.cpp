#include "core/render/visible_rays.h"

#include <algorithm>
#include <cmath>

#include "core/kernels/hash_grid_simd.h"
#include "core/kernels/spherical_harmonics_ref.h"

namespace fieldgraft {
namespace {

constexpr int wave_samples = 8;  // of a ray, looked at together: few are looked at that nobody sees
constexpr std::size_t block_samples = 1024;

}  // namespace

// Rows in the order of the rays that had samples left.
struct VisibleRays::Wave {
    std::vector<std::int64_t> ray;   // of each of its segments
    std::vector<std::size_t> first;  // a segment's first row; one more at the end
    std::vector<float> positions;    // 3×n, unit cube
    std::vector<float> t;
    // n rows, n rows, n; written before they are read, so not filled with zeros first.
    std::unique_ptr<float[]> encoded, features, density;
    std::vector<float> hiding, probed;  // of a probe

    const float* hides() const { return hiding.empty() ? density.get() : hiding.data(); }
};

VisibleRays::VisibleRays(const KernelField& field, const MarchGrid& cells, const RayRange& rays, Encoded encoded,
                         const SampleProbe* probe)
    : field_(field),
      cells_(cells),
      rays_(rays),
      encoded_(encoded),
      probe_(probe),
      limit_(-std::log(rays.min_transmittance)) {
    find();
    sort_by_ray();
}

VisibleRays::~VisibleRays() = default;

std::size_t VisibleRays::looked_at() const {
    std::size_t samples = 0;
    for (const auto& wave : waves_) samples += wave->t.size();
    return samples;
}

void VisibleRays::find() {
    std::vector<RayMarcher> marchers;
    std::vector<std::int64_t> active;
    marchers.reserve(rays_.count());
    for (std::int64_t r = 0; r < rays_.count(); ++r) {
        marchers.emplace_back(cells_, rays_.march, rays_.first + r);
        active.push_back(r);
    }
    depth_.assign(rays_.count(), 0.0);
    while (!active.empty()) {
        waves_.push_back(std::make_unique<Wave>());
        Wave& wave = *waves_.back();
        const std::vector<bool> more = collect(marchers, active, wave);
        evaluate(wave);
        active = look_past(wave, more);
    }
}

// The waves noted the segments one after the other: by ray, keeping their order.
void VisibleRays::sort_by_ray() {
    first_segment_.assign(rays_.count() + 1, 0);
    start_.assign(rays_.count() + 1, 0);
    for (const Segment& s : segments_) {
        ++first_segment_[s.ray + 1];
        start_[s.ray + 1] += s.count;
    }
    for (std::int64_t r = 0; r < rays_.count(); ++r) {
        first_segment_[r + 1] += first_segment_[r];
        start_[r + 1] += start_[r];
    }
    std::vector<Segment> sorted(segments_.size());
    std::vector<std::size_t> place = first_segment_;
    for (const Segment& s : segments_) sorted[place[s.ray]++] = s;
    segments_ = std::move(sorted);
}

// The next samples of the active rays; whether each of them may have more.
std::vector<bool> VisibleRays::collect(std::vector<RayMarcher>& marchers, const std::vector<std::int64_t>& active,
                                       Wave& wave) {
    const float scale = static_cast<float>(1.0 / longest_edge(field_.box_min, field_.box_max));
    float low[3];
    for (int c = 0; c < 3; ++c) low[c] = static_cast<float>(field_.box_min[c]);
    std::vector<float> axes[3];
    for (auto& axis : axes) axis.reserve(active.size() * wave_samples);
    wave.t.reserve(active.size() * wave_samples);
    std::vector<bool> more;
    for (const std::int64_t r : active) {
        const std::size_t before = wave.t.size();
        float position[3], t;
        int found = 0;
        while (found < wave_samples && marchers[r].next(position, t)) {
            for (int c = 0; c < 3; ++c) axes[c].push_back((position[c] - low[c]) * scale);
            wave.t.push_back(t);
            ++found;
        }
        if (found == 0) continue;
        wave.ray.push_back(r);
        wave.first.push_back(before);
        more.push_back(found == wave_samples);
    }
    wave.first.push_back(wave.t.size());
    wave.positions.reserve(3 * wave.t.size());
    for (const auto& axis : axes) wave.positions.insert(wave.positions.end(), axis.begin(), axis.end());
    return more;
}

void VisibleRays::ask_field(const float* positions, std::size_t n, float* encoded, float* features,
                            float* density) const {
    hash_grid_encode(*field_.grid, field_.table, positions, n, encoded, field_.encoded_row);
    density_mlp_forward(field_.weights, encoded, static_cast<int>(n), features);
    for (std::size_t i = 0; i < n; ++i) {
        const float log_density = features[i * field_.feature_row] + static_cast<float>(log_density_offset);
        // A NaN stays one.
        const float limit = static_cast<float>(log_density_limit);
        density[i] = std::exp(log_density > limit ? limit : log_density);
    }
}

void VisibleRays::evaluate(Wave& wave) const {
    const std::size_t n = wave.t.size();
    wave.features = std::make_unique_for_overwrite<float[]>(n * field_.feature_row);
    wave.density = std::make_unique_for_overwrite<float[]>(n);
    if (probe_ == nullptr) {
        wave.encoded = std::make_unique_for_overwrite<float[]>(n * field_.encoded_row);
        ask_field(wave.positions.data(), n, wave.encoded.get(), wave.features.get(), wave.density.get());
        if (encoded_ == Encoded::dropped) wave.encoded.reset();
        return;
    }
    ask_in_own_cells(wave);
    wave.hiding.resize(n);
    wave.probed.assign(n * probe_->columns(), 0.0f);
    probe_->look(wave.positions.data(), n, wave.density.get(), wave.hiding.data(), wave.probed.data());
}

// Features are 0 where f is not.
void VisibleRays::ask_in_own_cells(Wave& wave) const {
    const std::size_t n = wave.t.size(), width = field_.feature_row;
    const float* all = wave.positions.data();
    std::vector<std::size_t> own;
    for (std::size_t i = 0; i < n; ++i) {
        if (probe_->own_cells().holds(all[i], all[n + i], all[2 * n + i])) own.push_back(i);
    }
    const std::size_t m = own.size();
    const auto encoded = std::make_unique_for_overwrite<float[]>(m * field_.encoded_row);
    if (m == n) return ask_field(all, n, encoded.get(), wave.features.get(), wave.density.get());
    std::vector<float> positions(3 * m), features(m * width), density(m);
    for (std::size_t c = 0; c < 3; ++c) {
        for (std::size_t i = 0; i < m; ++i) positions[c * m + i] = all[c * n + own[i]];
    }
    ask_field(positions.data(), m, encoded.get(), features.data(), density.data());
    std::fill_n(wave.features.get(), n * width, 0.0f);
    std::fill_n(wave.density.get(), n, 0.0f);
    for (std::size_t i = 0; i < m; ++i) {
        std::copy_n(features.data() + i * width, width, wave.features.get() + own[i] * width);
        wave.density[own[i]] = density[i];
    }
}

// Notes which samples can be seen; returns the rays that see past them.
std::vector<std::int64_t> VisibleRays::look_past(Wave& wave, const std::vector<bool>& more) {
    std::vector<std::int64_t> active;
    const float step = static_cast<float>(rays_.march.step);
    for (std::size_t i = 0; i < wave.ray.size(); ++i) {
        const std::int64_t r = wave.ray[i];
        const float* hides = wave.hides();
        std::size_t k = wave.first[i];
        for (; k < wave.first[i + 1] && depth_[r] <= limit_; ++k) {
            depth_[r] += std::min(static_cast<double>(hides[k]) * step, 1e30);
        }
        segments_.push_back({r, &wave, wave.first[i], k - wave.first[i]});
        if (more[i] && depth_[r] <= limit_) active.push_back(r);
    }
    return active;
}

bool VisibleRays::next(RayBlock& block) {
    if (taken_ == rays_.count()) return false;
    block.begin = taken_;
    do {
        ++taken_;
    } while (taken_ < rays_.count() && start_[taken_ + 1] - start_[block.begin] <= block_samples);
    block.end = taken_;
    gather(block);
    fill_basis(block);
    return true;
}

void VisibleRays::gather(RayBlock& block) const {
    const std::size_t samples = start_[block.end] - start_[block.begin];
    const std::size_t e = field_.encoded_row, f = field_.feature_row;
    block.start.resize(block.rays() + 1);
    block.ray.resize(samples);
    block.positions.resize(3 * samples);
    block.t.resize(samples);
    block.delta.assign(samples, static_cast<float>(rays_.march.step));
    const bool keep = encoded_ == Encoded::kept && probe_ == nullptr;
    block.encoded.resize(keep ? samples * e : 0);
    block.features.resize(samples * f);
    block.density.resize(samples);
    const std::size_t p = probe_ == nullptr ? 0 : probe_->columns();
    block.probed.resize(samples * p);
    std::size_t at = 0;
    for (std::int64_t r = block.begin; r < block.end; ++r) {
        block.start[r - block.begin] = static_cast<std::int64_t>(at);
        for (std::size_t i = first_segment_[r]; i < first_segment_[r + 1]; ++i) {
            const Segment& s = segments_[i];
            const Wave& w = *s.wave;
            const std::size_t n = w.t.size();
            if (keep) std::copy_n(w.encoded.get() + s.first * e, s.count * e, block.encoded.data() + at * e);
            std::copy_n(w.features.get() + s.first * f, s.count * f, block.features.data() + at * f);
            std::copy_n(w.density.get() + s.first, s.count, block.density.data() + at);
            std::copy_n(w.t.data() + s.first, s.count, block.t.data() + at);
            std::copy_n(w.probed.data() + s.first * p, s.count * p, block.probed.data() + at * p);
            std::fill_n(block.ray.data() + at, s.count, static_cast<std::int32_t>(r - block.begin));
            for (int c = 0; c < 3; ++c) {
                std::copy_n(w.positions.data() + c * n + s.first, s.count, block.positions.data() + c * samples + at);
            }
            at += s.count;
        }
    }
    block.start.back() = static_cast<std::int64_t>(at);
}

void VisibleRays::fill_basis(RayBlock& block) const {
    const std::size_t rays = block.rays(), terms = static_cast<std::size_t>(field_.sh_degree) * field_.sh_degree;
    std::vector<float> directions(3 * rays), values(terms * rays);
    for (std::size_t r = 0; r < rays; ++r) {
        const float* direction = rays_.march.directions.data() + 3 * (rays_.first + block.begin + r);
        for (int c = 0; c < 3; ++c) directions[c * rays + r] = direction[c];
    }
    spherical_harmonics<float>(field_.sh_degree, directions, values);
    block.basis.assign(rays * field_.basis_row, 0.0f);
    for (std::size_t r = 0; r < rays; ++r) {
        for (std::size_t i = 0; i < terms; ++i) block.basis[r * field_.basis_row + i] = values[i * rays + r];
    }
}

}  // namespace fieldgraft
