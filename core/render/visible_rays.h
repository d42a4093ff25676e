// The samples that a range of rays can see of the original field, found by one thread without a tensor or a graph.
//
// Depth waves: every ray that still sees on takes its next 8 samples; encoding and density network run over
// the whole wave (level by level: the table's levels stay in the cache); a ray ends where the transmittance in front of
// a sample falls to `min_transmittance` (0: nowhere). What is found is sample_visible's (march.h), up to rounding.
//
// Blocks of whole rays, about a thousand samples, are then taken out of the waves: small enough that what a network
// computes of them stays in the second-level cache. Not differentiated here; ray_fit.h is.
#pragma once

#include <memory>
#include <vector>

#include "core/field/kernel_edit.h"
#include "core/field/kernel_field.h"

namespace fieldgraft {

struct RayRange {
    MarchRays march;
    std::int64_t first, last;  // rays of `march`
    double min_transmittance;

    std::int64_t count() const { return last - first; }
};

// Samples of consecutive rays, row-major, nearest first.
struct RayBlock {
    std::int64_t begin = 0, end = 0;  // rays, counted from the range's first
    std::vector<std::int64_t> start;  // end − begin + 1
    std::vector<std::int32_t> ray;    // N, counted from `begin`
    std::vector<float> positions;     // 3×N, unit cube
    std::vector<float> t, delta;      // N
    std::vector<float> encoded;       // N rows; none where they are not wanted
    std::vector<float> features;      // N rows
    std::vector<float> density;       // N
    std::vector<float> basis;         // one row a ray: spherical harmonics of its direction
    std::vector<float> probed;        // N rows of what a probe found

    std::size_t samples() const { return density.size(); }
    std::int64_t rays() const { return end - begin; }
};

// What else is asked of samples while the visible ones are looked for.
class SampleProbe {
  public:
    virtual ~SampleProbe() = default;
    // Numbers a sample, which go with it into its block.
    virtual std::size_t columns() const = 0;
    // f's own cells: elsewhere its density is 0, and it is not asked.
    virtual const UnitCells& own_cells() const = 0;
    // positions 3×n, unit cube; density n: f's; hiding n: what hides the samples behind, to be written; rows
    // n×columns(), zero before. One thread of several.
    virtual void look(const float* positions, std::size_t n, const float* density, float* hiding,
                      float* rows) const = 0;
};

class VisibleRays {
  public:
    enum class Encoded { kept, dropped };  // only gradients need it again
    // `probe` may be null: then density hides. With one the encoding is not kept.
    VisibleRays(const KernelField& field, const MarchGrid& cells, const RayRange& rays, Encoded encoded = Encoded::kept,
                const SampleProbe* probe = nullptr);
    ~VisibleRays();

    std::size_t samples() const { return start_.back(); }
    // Samples that the field was asked of to find them.
    std::size_t looked_at() const;
    // The next block; false when all rays have been taken. Rays without samples are in it.
    bool next(RayBlock& block);

  private:
    struct Wave;
    // Part of a ray's visible samples: rows of a wave.
    struct Segment {
        std::int64_t ray;
        const Wave* wave;
        std::size_t first, count;
    };
    void find();
    void sort_by_ray();
    std::vector<bool> collect(std::vector<RayMarcher>& marchers, const std::vector<std::int64_t>& active, Wave& wave);
    void evaluate(Wave& wave) const;
    void ask_field(const float* positions, std::size_t n, float* encoded, float* features, float* density) const;
    void ask_in_own_cells(Wave& wave) const;
    std::vector<std::int64_t> look_past(Wave& wave, const std::vector<bool>& more);
    void gather(RayBlock& block) const;
    void fill_basis(RayBlock& block) const;

    const KernelField& field_;
    const MarchGrid& cells_;
    const RayRange rays_;
    const Encoded encoded_;
    const SampleProbe* probe_;
    const double limit_;  // of the optical depth in front of a sample
    std::vector<double> depth_;
    std::vector<std::unique_ptr<Wave>> waves_;
    std::vector<Segment> segments_;           // ray after ray, nearest first
    std::vector<std::size_t> first_segment_;  // of each ray; one more at the end
    std::vector<std::size_t> start_;          // each ray's first sample; one more at the end
    std::int64_t taken_ = 0;
};

}  // namespace fieldgraft
