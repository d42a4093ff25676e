// One pass over a range of rays through the original field, without recording a graph: drawing them, or fitting them.
// The result is that of sample_visible, RadianceField, composite and autograd on the same rays, up to rounding (the
// tests compare them). One thread a range; callers share ranges out.
//
//   color = Σ w c     transmittance T = Π (1 − α)     depth = Σ w t / Σ w            (composite_ref.h)
//   loss  = mean over rays and channels of E_b[(C + T b − (αc + (1 − α) b))²]        b: uniform over [0, 1]
//         = mean of ΔC² + ΔC ΔT + ΔT²/3,   ΔC = C − αc,  ΔT = T − (1 − α)
//
// C: color, T: transmittance; c and α: the pixel's. Fitting over random backgrounds makes what is transparent
// transparent and what is opaque opaque; their mean, in closed form, does it without the noise of drawing them.
// Pictures without alpha whose background b is known are fitted over that one: loss = mean of (C + T b − c)², and of
// 0.05 (1 − T)² where a pixel shows b itself (every channel within 0.03): haze of that colour would look like nothing.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>

#include "core/kernels/hash_grid_simd.h"
#include "core/render/visible_rays.h"

namespace fieldgraft {

// Rays a range where a caller shares them out: enough to be worth a thread's while, few enough for every thread.
constexpr std::int64_t rays_a_range = 512;

// color 3·R, transmittance R and depth R of all rays of `rays.march`; the range's part is written.
void draw_range(const KernelField& field, const MarchGrid& cells, const RayRange& rays, std::span<float> color,
                std::span<float> transmittance, std::span<float> depth);

// What fitting a range leaves behind. The encoding's gradients stay with their samples, so that the table's levels can
// be dealt to threads and no two of them touch one entry (hash_grid_add_gradient).
struct RangeFit {
    double squared_error = 0;  // sum over rays and channels, of the pictures alone
    std::size_t samples = 0;   // that were visible
    bool finite = true;        // of encoded_grad
    FieldMlpGradients gradients;
    std::unique_ptr<float[]> positions;     // 3×samples, unit cube
    std::unique_ptr<float[]> encoded_grad;  // level after level: levels×samples×F

    explicit RangeFit(const FieldMlpShape& shape) : gradients(shape) {}
    HashGridRows rows(const HashGrid& grid) const;
};

// The colour behind everything, where pictures have no alpha to tell it apart.
using PlainBackground = std::optional<std::array<float, 3>>;

// pixels: R×4, straight alpha last, of all rays of `rays.march`; over `background` if it is given, else over all.
// `fit` is fresh; gradients are of the mean over all R rays.
void fit_range(const KernelField& field, const MarchGrid& cells, const RayRange& rays, std::span<const float> pixels,
               const PlainBackground& background, RangeFit& fit);

}  // namespace fieldgraft
