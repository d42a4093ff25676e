#include "core/edit/packed_patch.h"

namespace fieldgraft {

namespace {

constexpr std::int64_t rays_per_task = 256;

// Calls body(k, origin, direction) for every sample k.
template <class Body>
void for_samples(const Tensor& start, const RayBundle& rays, Body body) {
    const std::int64_t* from = start.const_data_ptr<std::int64_t>();
    const float *origins = rays.origins.const_data_ptr<float>(), *directions = rays.directions.const_data_ptr<float>();
    at::parallel_for(0, start.size(0) - 1, rays_per_task, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t r = begin; r < end; ++r) {
            for (std::int64_t k = from[r]; k < from[r + 1]; ++k) body(k, origins + 3 * r, directions + 3 * r);
        }
    });
}

}  // namespace

PackedPatch::PackedPatch(const FrozenPatch& patch, const RayBundle& rays)
    : rest_(patch),
      rays_{rays.origins.contiguous(), rays.directions.contiguous()},
      t_(at::empty({patch.samples()}, at::kFloat)),
      color_(patch.color.to(at::kHalf)),
      acts_(at::zeros({patch.samples()}, at::kBool).index_fill_(0, patch.acting, true)) {
    const float* positions = patch.positions.const_data_ptr<float>();
    float* t = t_.mutable_data_ptr<float>();
    for_samples(rest_.start, rays_, [&](std::int64_t k, const float* o, const float* d) {
        const float* p = positions + 3 * k;
        t[k] = (p[0] - o[0]) * d[0] + (p[1] - o[1]) * d[1] + (p[2] - o[2]) * d[2];
    });
    rest_.positions = rest_.color = rest_.acting = Tensor();
}

FrozenPatch PackedPatch::unpacked() const {
    FrozenPatch patch = rest_;
    patch.color = color_.to(at::kFloat);
    patch.acting = acts_.nonzero().squeeze(1);
    patch.positions = at::empty({t_.size(0), 3}, at::kFloat);
    const float* t = t_.const_data_ptr<float>();
    float* positions = patch.positions.mutable_data_ptr<float>();
    for_samples(patch.start, rays_, [&](std::int64_t k, const float* o, const float* d) {
        for (int c = 0; c < 3; ++c) positions[3 * k + c] = o[c] + t[k] * d[c];
    });
    return patch;
}

std::size_t PackedPatch::bytes() const {
    std::size_t total = 0;
    for (const Tensor* tensor :
         {&rest_.start, &rest_.delta, &rest_.density, &rest_.image, &rest_.opacity, &rest_.masks.positive,
          &rest_.masks.negative, &rays_.origins, &rays_.directions, &t_, &color_, &acts_})
        total += tensor->defined() ? tensor->nbytes() : 0;
    return total;
}

}  // namespace fieldgraft
