#include "core/kernels/exp_simd.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/exp_simd.cpp"
#include "core/kernels/simd_targets.h"
// Must come after the choice of targets.
#include <hwy/contrib/math/math-inl.h>

HWY_BEFORE_NAMESPACE();
namespace fieldgraft {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Lanes = hn::ScalableTag<float>;
using Vector = hn::Vec<Lanes>;

// out[i] = f(−x[i]), whole vectors and a filled-up last one.
template <class F>
HWY_INLINE void of_negative(const float* x, std::size_t n, float* out, F f) {
    const Lanes d;
    const std::size_t lanes = hn::Lanes(d);
    const auto value = [&](Vector v) HWY_ATTR {
        // Beyond 104 nothing is left of e^−x in float32.
        const Vector bounded = hn::IfThenElse(hn::Lt(v, hn::Set(d, 104.0f)), v, hn::Set(d, 104.0f));
        return hn::IfThenElse(hn::Eq(v, v), f(d, hn::Neg(bounded)), v);
    };
    std::size_t i = 0;
    for (; i + lanes <= n; i += lanes) hn::StoreU(value(hn::LoadU(d, x + i)), d, out + i);
    if (i == n) return;
    HWY_ALIGN float rest[HWY_LANES(float)] = {};
    for (std::size_t k = i; k < n; ++k) rest[k - i] = x[k];
    hn::Store(value(hn::Load(d, rest)), d, rest);
    for (std::size_t k = i; k < n; ++k) out[k] = rest[k - i];
}

void exp_of(const float* x, std::size_t n, float* out) {
    of_negative(x, n, out, [](Lanes d, Vector v) HWY_ATTR { return hn::Exp(d, v); });
}

void one_minus_exp_of(const float* x, std::size_t n, float* out) {
    of_negative(x, n, out, [](Lanes d, Vector v) HWY_ATTR { return hn::Neg(hn::Expm1(d, v)); });
}

}  // namespace HWY_NAMESPACE
}  // namespace fieldgraft
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fieldgraft {

HWY_EXPORT(exp_of);
HWY_EXPORT(one_minus_exp_of);

void exp_negative(const float* x, std::size_t n, float* out) {
    HWY_DYNAMIC_DISPATCH(exp_of)(x, n, out);
}

void one_minus_exp_negative(const float* x, std::size_t n, float* out) {
    HWY_DYNAMIC_DISPATCH(one_minus_exp_of)(x, n, out);
}

}  // namespace fieldgraft
#endif  // HWY_ONCE
