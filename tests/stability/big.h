// Numbers of 50 decimal digits, and the functions of them that the oracles of this folder are made of.
#pragma once

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>

#include "tests/kernels/blend_oracle.h"

namespace fieldgraft::stability {

using Big = boost::multiprecision::cpp_bin_float_50;

// eˣ; what lies below every float (and far below) is 0.
inline Big exp_of(const Big& x) {
    return x < -2000 ? Big(0) : Big(boost::multiprecision::exp(x));
}

// 1 − eˣ to all digits: the series where the difference would cancel.
inline Big minus_expm1_of(const Big& x) {
    if (x < Big(-0.01) || x > Big(0.01)) return 1 - exp_of(x);
    Big term = -x, sum = -x;
    for (int n = 2; n < 30; ++n) {
        term *= x / n;
        sum += term;
    }
    return sum;
}

// log(1 + eᶻ).
inline Big softplus_of(const Big& z) {
    const Big e = exp_of(z > 0 ? Big(-z) : z);
    // log1p(e): the series alone is exact to 50 digits where e is small.
    Big rest = e;
    if (e > Big(1e-5)) {
        rest = boost::multiprecision::log(1 + e);
    } else {
        rest = e * (1 - e * (Big(1) / 2 - e * (Big(1) / 3 - e * (Big(1) / 4 - e * (Big(1) / 5 - e / 6)))));
    }
    return z > 0 ? Big(z + rest) : rest;
}

inline Big sigmoid_of(const Big& z) {
    return z >= 0 ? Big(1 / (1 + exp_of(-z))) : Big(exp_of(z) / (1 + exp_of(z)));
}

// |found − right| beyond `floor`, in units of `unit`; infinite for a NaN or an Inf.
inline double error_of(double found, const Big& right, const Big& unit, double floor = 0) {
    if (!std::isfinite(found)) return std::numeric_limits<double>::infinity();
    const Big miss = boost::multiprecision::abs(Big(found) - right) - floor;
    if (miss <= 0) return 0;
    return unit > 0 ? static_cast<double>(Big(miss / unit)) : std::numeric_limits<double>::infinity();
}

}  // namespace fieldgraft::stability

namespace fieldgraft::oracle {

template <>
struct Math<stability::Big> {
    using Plain = stability::Big;
    static const Plain& value(const Plain& x) { return x; }
    static Plain exp(const Plain& x) { return stability::exp_of(x); }
    static Plain minus_expm1(const Plain& x) { return stability::minus_expm1_of(x); }
};

}  // namespace fieldgraft::oracle
