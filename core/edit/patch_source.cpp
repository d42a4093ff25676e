#include "core/edit/patch_source.h"

#include <algorithm>

#include "core/edit/mask_ops.h"
#include "core/edit/ray_sums.h"
#include "core/edit/segmentation.h"
#include "core/edit/vote_grid.h"
#include "core/scene/patch_sampler.h"

namespace fieldgraft {

namespace {

constexpr int steps_outside =
    4;  // of a march outside f's cells that become one sample: g is smooth, its cells are large
constexpr std::size_t most_bytes = 1'500'000'000;

// The pixels that look into `cells` before the base has swallowed half the light.
Tensor sees_cells(const Samples& samples, const Tensor& density, const Tensor& cells, const FieldGeometry& geometry) {
    const Tensor cell = cell_of(geometry, static_cast<int>(cells.size(0)), samples.positions);
    const Tensor inside = cells.reshape(-1).index_select(0, cell.clamp_min(0)).to(at::kBool).logical_and(cell >= 0);
    const Tensor lit = transmittance_before(samples.start, samples.ray, samples.delta, density) > 0.5;
    const std::int64_t rays = samples.start.size(0) - 1;
    return sum_over_rays(inside.logical_and(lit).to(at::kFloat), samples.ray, rays) > 0.5;
}

}  // namespace

PatchSource::PatchSource(const BaseMedium& base, const EditCameras& cameras, const EditSpec& spec, const EditPlan& plan,
                         const EditRegion& region, Guidance& guide)
    : base_(base), cameras_(cameras), spec_(spec), plan_(plan), region_(region), guide_(guide) {}

FrozenPatch PatchSource::patch(std::uint64_t number) {
    ++calls_;
    if (const auto found = kept_.find(number); found != kept_.end()) {
        found->second.used = calls_;
        return found->second.patch.unpacked();
    }
    Random random(spec_.seed, 1000 + number);
    const Camera camera = cameras_.draw(random);
    const Patch pixels = sample_patch(camera.width, camera.height, spec_.patch, random);
    const Rays drawn = rays_through_pixels(camera, pixels.pixels());
    const RayBundle rays{drawn.origins, drawn.directions};
    // Masks the user has drawn correct the segmenter's once every five iterations (Blending-NeRF, appendix E).
    const bool drawn_turn = !spec_.masks.empty() && number % 5 == 4;
    // Packed even where it is not kept: the same bits whether it comes out of the pool or not.
    PackedPatch patch(make(rays, spec_.patch, plan_.segmenter_per_view && !drawn_turn), rays);
    FrozenPatch unpacked = patch.unpacked();
    if (spec_.camera_pool > 0) keep(number, std::move(patch));
    return unpacked;
}

void PatchSource::keep(std::uint64_t number, PackedPatch patch) {
    const auto used_before = [](const auto& a, const auto& b) { return a.second.used < b.second.used; };
    kept_bytes_ += patch.bytes();
    while (!kept_.empty() && kept_bytes_ > most_bytes) {
        const auto oldest = std::min_element(kept_.begin(), kept_.end(), used_before);
        kept_bytes_ -= oldest->second.patch.bytes();
        kept_.erase(oldest);
    }
    kept_[number] = {std::move(patch), calls_};
}

FrozenPatch PatchSource::view(const Camera& camera, int size) const {
    const Rays rays = rays_of_view(square(camera, size));
    return make({rays.origins, rays.directions}, size, false);
}

FrozenPatch PatchSource::make(const RayBundle& rays, int size, bool per_view_mask) const {
    at::NoGradGuard no_gradients;
    BaseQuery query;
    query.extra_cells = region_.volume;
    query.acting_cells = region_.confine;
    query.removable = plan_.operations.remove;
    query.extra_stride = steps_outside;
    BaseSamples base = base_.sample(rays, query);
    FrozenPatch patch;
    patch.size = size;
    patch.start = base.samples.start;
    patch.positions = base.samples.positions;
    patch.delta = base.samples.delta;
    patch.density = base.density;
    patch.color = base.color;
    const Tensor weight = sample_weights(base.samples.start, base.samples.ray, base.samples.delta, base.density);
    patch.image = sum_over_rays(weight.unsqueeze(1) * base.color, base.samples.ray, rays.size());
    patch.opacity = sum_over_rays(weight, base.samples.ray, rays.size()).clamp(0, 1);
    // Where only colours change, a sample that carries next to nothing of its pixel need not be asked.
    const Tensor asked = plan_.geometry_fixed ? base.acting.logical_and(weight > 1e-3) : base.acting;
    patch.acting = asked.nonzero().squeeze(1);
    const int dilations = spec_.dilations();
    if (per_view_mask) {
        const Tensor picture = patch.over(at::ones({3}));
        const Tensor mask = segment_difference(guide_, picture, spec_.segmented_text()) > 0;
        patch.masks = region_masks(mask, dilations, size);
    } else if (region_.score.defined()) {
        patch.masks = region_masks(region_mask(base.samples, patch, weight), region_.volume.defined() ? 0 : dilations,
                                   dilations, size);
    } else {
        const Tensor none = at::zeros({size, size}, at::kBool);
        patch.masks = {none, none};
    }
    patch.area = patch.masks.positive.sum().item<double>();
    return patch;
}

Tensor PatchSource::region_mask(const Samples& samples, const FrozenPatch& patch, const Tensor& weight) const {
    Tensor mask = at::zeros({patch.opacity.size(0)}, at::kBool);
    if (region_.on_surface) {
        const Tensor score = sample_grid(region_.score, base_.geometry(), patch.positions);
        const Tensor shown = sum_over_rays(weight * (score > 0.5), samples.ray, patch.opacity.size(0));
        mask = (shown > 0.5 * patch.opacity).logical_and(patch.opacity > 0.3);
    }
    if (region_.volume.defined())
        mask = mask.logical_or(sees_cells(samples, patch.density, region_.volume, base_.geometry()));
    return mask.reshape({patch.size, patch.size});
}

}  // namespace fieldgraft
