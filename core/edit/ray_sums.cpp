#include "core/edit/ray_sums.h"

#include <stdexcept>

namespace fieldgraft {

Tensor transmittance_before(const Tensor& start, const Tensor& ray, const Tensor& delta, const Tensor& density) {
    if (delta.sizes() != density.sizes() || ray.sizes() != delta.sizes())
        throw std::invalid_argument("transmittance_before: ray, delta and density must all be N");
    const Tensor depth = (density.to(at::kDouble) * delta.to(at::kDouble)).clamp(0, 100);
    // The depth before each sample: what the whole packed array has before it, less what it has before its ray.
    const Tensor before = at::cumsum(depth, 0) - depth;
    const Tensor padded = at::cat({before, at::zeros({1}, before.options())});
    const Tensor first = padded.index_select(0, start.slice(0, 0, start.size(0) - 1));
    return (first.index_select(0, ray) - before).exp().to(at::kFloat);
}

Tensor sample_weights(const Tensor& start, const Tensor& ray, const Tensor& delta, const Tensor& density) {
    return -at::expm1(-(density * delta).clamp_max(1e30)) * transmittance_before(start, ray, delta, density);
}

Tensor sum_over_rays(const Tensor& values, const Tensor& ray, std::int64_t rays) {
    std::vector<std::int64_t> shape = values.sizes().vec();
    shape[0] = rays;
    return at::zeros(shape, values.options()).index_add_(0, ray, values);
}

}  // namespace fieldgraft
