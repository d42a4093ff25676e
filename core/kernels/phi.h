// φ(x) = (1 − e⁻ˣ)/x and its derivative for x ≥ 0: the share of an interval's optical depth that reaches the camera.
//
// φ(0) = 1, φ'(0) = −½. φ' cancels near 0 ((e⁻ˣ − φ)/x loses all digits below x ~ 1e-4), so there it is its Taylor
// series. Relative error a few units in the last place; both decay to 0 (φ ~ 1/x, φ' ~ −1/x²) with no overflow up to
// 1e30.
#pragma once

#include <cmath>

namespace fieldgraft {

template <class Real>
inline Real phi(Real x) {
    return x < Real(1e-30) ? Real(1) : -std::expm1(-x) / x;
}

// φ'(x) = Σ_{n≥1} (−1)ⁿ n xⁿ⁻¹/(n+1)!, 12 terms below x = ½ (remainder < 1e-13), else (e⁻ˣ − φ)/x.
template <class Real>
inline Real phi_derivative(Real x) {
    if (x >= Real(0.5)) return (std::exp(-x) - phi(x)) / x;
    constexpr double coefficients[] = {-1. / 2,      1. / 3,       -1. / 8,        1. / 30,
                                       -1. / 144,    1. / 840,     -1. / 5760,     1. / 45360,
                                       -1. / 403200, 1. / 3991680, -1. / 43545600, 1. / 518918400};
    Real sum = 0;
    for (int n = 11; n >= 0; --n) sum = sum * x + Real(coefficients[n]);
    return sum;
}

}  // namespace fieldgraft
