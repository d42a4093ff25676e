#include "core/kernels/adam_ref.h"

#include <atomic>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace fieldgraft {
namespace {

constexpr std::int64_t entries_per_task = 1 << 14;
constexpr std::int64_t run = 16;  // entries looked at together: a run of zeros is skipped at once

template <class T>
struct Rule {
    T b1, c1, b2, c2, rate, inverse2, epsilon;

    // No branch: where `keep` says so the old values are written back, and the loop over a run is vectorised.
    template <bool skip_zero>
    void update(std::int64_t count, const T* g, T* p, T* m, T* v) const {
        for (std::int64_t i = 0; i < count; ++i) {
            const bool keep = skip_zero && g[i] == 0;
            const T m_new = b1 * m[i] + c1 * g[i], v_new = b2 * v[i] + c2 * g[i] * g[i];
            const T p_new = p[i] - rate * m_new / (std::sqrt(v_new * inverse2) + epsilon);
            p[i] = keep ? p[i] : p_new;
            m[i] = keep ? m[i] : m_new;
            v[i] = keep ? v[i] : v_new;
        }
    }
};

template <class T>
bool all_zero(const T* g, std::int64_t count) {
    T largest = 0;
    for (std::int64_t i = 0; i < count; ++i) largest = std::fabs(g[i]) > largest ? std::fabs(g[i]) : largest;
    return largest == 0;
}

}  // namespace

template <class T>
void adam_step(const AdamStep& step, std::span<const T> grad, std::span<T> parameters, std::span<T> m, std::span<T> v,
               const ParallelFor& parallel_for) {
    const std::size_t n = parameters.size();
    if (grad.size() != n || m.size() != n || v.size() != n) {
        throw std::invalid_argument("adam: gradient or moments do not match " + std::to_string(n) + " parameters");
    }
    if (step.t < 1) throw std::invalid_argument("adam: steps count from 1, not " + std::to_string(step.t));
    const double t = static_cast<double>(step.t);
    const Rule<T> rule{static_cast<T>(step.beta1),
                       static_cast<T>(1 - step.beta1),
                       static_cast<T>(step.beta2),
                       static_cast<T>(1 - step.beta2),
                       static_cast<T>(step.rate / (1 - std::pow(step.beta1, t))),
                       static_cast<T>(1 / (1 - std::pow(step.beta2, t))),
                       static_cast<T>(step.epsilon)};
    parallel_for(static_cast<std::int64_t>(n), entries_per_task, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t first = begin; first < end; first += run) {
            const std::int64_t last = first + run < end ? first + run : end;
            const T* g = grad.data() + first;
            if (!step.skip_zero) {
                rule.template update<false>(last - first, g, &parameters[first], &m[first], &v[first]);
            } else if (!all_zero(g, last - first)) {
                rule.template update<true>(last - first, g, &parameters[first], &m[first], &v[first]);
            }
        }
    });
}

template <class T>
bool all_finite(std::span<const T> values, const ParallelFor& parallel_for) {
    std::atomic<bool> finite{true};
    parallel_for(static_cast<std::int64_t>(values.size()), entries_per_task, [&](std::int64_t begin, std::int64_t end) {
        int bad = 0;  // no early way out: a plain reduction is vectorised
        for (std::int64_t i = begin; i < end; ++i) bad |= !(std::fabs(values[i]) <= std::numeric_limits<T>::max());
        if (bad != 0) finite = false;
    });
    return finite;
}

template bool all_finite<float>(std::span<const float>, const ParallelFor&);
template bool all_finite<double>(std::span<const double>, const ParallelFor&);
template void adam_step<float>(const AdamStep&, std::span<const float>, std::span<float>, std::span<float>,
                               std::span<float>, const ParallelFor&);
template void adam_step<double>(const AdamStep&, std::span<const double>, std::span<double>, std::span<double>,
                                std::span<double>, const ParallelFor&);

}  // namespace fieldgraft
