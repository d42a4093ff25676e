#include "core/kernels/adam_simd.h"

#include <cmath>
#include <stdexcept>
#include <string>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/adam_simd.cpp"
#include "core/kernels/simd_targets.h"

HWY_BEFORE_NAMESPACE();
namespace fieldgraft {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// Whole vectors of `D` from `first` on; returns where they end.
template <bool skip_zero, class D>
HWY_INLINE std::size_t update(D d, const AdamStep& step, std::size_t first, std::size_t n, const float* grad,
                              float* parameters, float* m, float* v) {
    const std::size_t lanes = hn::Lanes(d);
    const double t = static_cast<double>(step.t);
    const auto set = [&](double value) HWY_ATTR { return hn::Set(d, static_cast<float>(value)); };
    const auto b1 = set(step.beta1), c1 = set(1 - step.beta1), b2 = set(step.beta2), c2 = set(1 - step.beta2);
    const auto rate = set(step.rate / (1 - std::pow(step.beta1, t)));
    const auto inverse2 = set(1 / (1 - std::pow(step.beta2, t))), epsilon = set(step.epsilon), zero = hn::Zero(d);
    for (; first + lanes <= n; first += lanes) {
        const auto g = hn::LoadU(d, grad + first);
        const auto untouched = hn::Eq(g, zero);  // NaN is not
        if (skip_zero && hn::AllTrue(d, untouched)) continue;
        const auto p_old = hn::LoadU(d, parameters + first), m_old = hn::LoadU(d, m + first),
                   v_old = hn::LoadU(d, v + first);
        auto m_new = hn::MulAdd(b1, m_old, hn::Mul(c1, g));
        auto v_new = hn::MulAdd(b2, v_old, hn::Mul(hn::Mul(c2, g), g));
        const auto below = hn::Add(hn::Sqrt(hn::Mul(v_new, inverse2)), epsilon);
        auto p_new = hn::Sub(p_old, hn::Div(hn::Mul(rate, m_new), below));
        if (skip_zero) {
            m_new = hn::IfThenElse(untouched, m_old, m_new);
            v_new = hn::IfThenElse(untouched, v_old, v_new);
            p_new = hn::IfThenElse(untouched, p_old, p_new);
        }
        hn::StoreU(m_new, d, m + first);
        hn::StoreU(v_new, d, v + first);
        hn::StoreU(p_new, d, parameters + first);
    }
    return first;
}

template <bool skip_zero>
HWY_INLINE void update_all(const AdamStep& step, std::size_t n, const float* grad, float* parameters, float* m,
                           float* v) {
    const std::size_t done = update<skip_zero>(hn::ScalableTag<float>(), step, 0, n, grad, parameters, m, v);
    update<skip_zero>(hn::CappedTag<float, 1>(), step, done, n, grad, parameters, m, v);
}

void adam_part(const AdamStep& step, const float* grad, std::size_t n, float* parameters, float* m, float* v) {
    if (step.skip_zero) {
        update_all<true>(step, n, grad, parameters, m, v);
    } else {
        update_all<false>(step, n, grad, parameters, m, v);
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace fieldgraft
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fieldgraft {

HWY_EXPORT(adam_part);

void adam_step_part(const AdamStep& step, std::span<const float> grad, std::span<float> parameters, std::span<float> m,
                    std::span<float> v) {
    const std::size_t n = parameters.size();
    if (grad.size() != n || m.size() != n || v.size() != n) {
        throw std::invalid_argument("adam: gradient or moments do not match " + std::to_string(n) + " parameters");
    }
    if (step.t < 1) throw std::invalid_argument("adam: steps count from 1, not " + std::to_string(step.t));
    HWY_DYNAMIC_DISPATCH(adam_part)(step, grad.data(), n, parameters.data(), m.data(), v.data());
}

}  // namespace fieldgraft
#endif  // HWY_ONCE
