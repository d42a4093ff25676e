#include "core/kernels/composite_ref.h"

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace fieldgraft {
namespace {

constexpr std::int64_t rays_per_task = 64;

// σδ, bounded so that no sum or product of depths becomes inf − inf or 0 · inf. NaN stays NaN.
template <class T>
inline T optical_depth(T density, T delta) {
    constexpr T largest = std::numeric_limits<T>::max();
    const T a = (density > largest ? largest : density) * delta;
    return a > T(1e30) ? T(1e30) : a;
}

template <class T>
void check(const CompositeInput<T>& in) {
    const std::size_t n = in.density.size();
    const bool fits = !in.start.empty() && in.start.front() == 0 && in.start.back() == static_cast<std::int64_t>(n) &&
                      in.delta.size() == n && in.t.size() == n && in.color.size() == 3 * n;
    if (!fits) throw std::invalid_argument("composite: sizes do not match " + std::to_string(n) + " samples");
}

template <class T>
void forward_ray(const CompositeInput<T>& in, std::int64_t first, std::int64_t last, T* color, T& transmittance,
                 T& depth) {
    double total = 0;  // Σ a so far
    double sum[3] = {}, weights = 0, distance = 0;
    for (std::int64_t k = first; k < last; ++k) {
        const T a = optical_depth(in.density[k], in.delta[k]);
        const T weight = -std::expm1(-a) * static_cast<T>(std::exp(static_cast<T>(-total)));
        for (int c = 0; c < 3; ++c) sum[c] += weight * in.color[3 * k + c];
        weights += weight;
        distance += weight * in.t[k];
        total += a;
    }
    for (int c = 0; c < 3; ++c) color[c] = static_cast<T>(sum[c]);
    transmittance = std::exp(static_cast<T>(-total));
    depth = weights > 0 ? static_cast<T>(distance / weights) : T(0);
}

template <class T>
void backward_ray(const CompositeInput<T>& in, std::int64_t first, std::int64_t last, const T* g, T g_transmittance,
                  T* density_grad, T* color_grad) {
    double total = 0;
    for (std::int64_t k = first; k < last; ++k) {
        color_grad[3 * k] = std::exp(static_cast<T>(-total));  // T_k, kept here until the colour's gradient replaces it
        total += optical_depth(in.density[k], in.delta[k]);
    }
    T after = std::exp(static_cast<T>(-total));
    double behind = static_cast<double>(g_transmittance) * after;  // g · what is seen past sample k
    for (std::int64_t k = last; k-- > first;) {
        const T a = optical_depth(in.density[k], in.delta[k]);
        const T alpha = -std::expm1(-a), before = color_grad[3 * k];
        const T* c = in.color.data() + 3 * k;
        const T shown = g[0] * c[0] + g[1] * c[1] + g[2] * c[2];
        density_grad[k] = a < T(1e30) ? static_cast<T>(after * shown - behind) * in.delta[k] : T(0);
        for (int i = 0; i < 3; ++i) color_grad[3 * k + i] = g[i] * alpha * before;
        behind += static_cast<double>(alpha * before) * shown;
        after = before;
    }
}

}  // namespace

template <class T>
void composite_forward(const CompositeInput<T>& input, std::span<T> color, std::span<T> transmittance,
                       std::span<T> depth, const ParallelFor& parallel_for) {
    check(input);
    const std::int64_t rays = static_cast<std::int64_t>(input.start.size()) - 1;
    parallel_for(rays, rays_per_task, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t r = begin; r < end; ++r) {
            forward_ray(input, input.start[r], input.start[r + 1], &color[3 * r], transmittance[r], depth[r]);
        }
    });
}

template <class T>
void composite_backward(const CompositeInput<T>& input, std::span<const T> color_out_grad,
                        std::span<const T> transmittance_grad, std::span<T> density_grad, std::span<T> color_grad,
                        const ParallelFor& parallel_for) {
    check(input);
    const std::int64_t rays = static_cast<std::int64_t>(input.start.size()) - 1;
    parallel_for(rays, rays_per_task, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t r = begin; r < end; ++r) {
            backward_ray(input, input.start[r], input.start[r + 1], &color_out_grad[3 * r], transmittance_grad[r],
                         density_grad.data(), color_grad.data());
        }
    });
}

#define FIELDGRAFT_INSTANTIATE(T)                                                                          \
    template void composite_forward<T>(const CompositeInput<T>&, std::span<T>, std::span<T>, std::span<T>, \
                                       const ParallelFor&);                                                \
    template void composite_backward<T>(const CompositeInput<T>&, std::span<const T>, std::span<const T>,  \
                                        std::span<T>, std::span<T>, const ParallelFor&);
FIELDGRAFT_INSTANTIATE(float)
FIELDGRAFT_INSTANTIATE(double)
#undef FIELDGRAFT_INSTANTIATE

}  // namespace fieldgraft
