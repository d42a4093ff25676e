// The blended equations written down once more, directly, for the tests of the kernels: plain sums over the samples of
// one ray, no recurrences. Templated on the number: Dual (long double with its derivative by one input, forward mode),
// or any other that Math knows (tests/stability/big.h: 50 digits).
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/kernels/blend_ref.h"

namespace fieldgraft::oracle {

// What the equations need of a number beside + − · /: Plain, value(x), exp(x) and minus_expm1(x) = 1 − eˣ.
template <class S>
struct Math;

struct Dual {
    long double value = 0, slope = 0;
    Dual(long double v = 0, long double s = 0) : value(v), slope(s) {}
    Dual operator+(const Dual& b) const { return {value + b.value, slope + b.slope}; }
    Dual operator-(const Dual& b) const { return {value - b.value, slope - b.slope}; }
    Dual operator*(const Dual& b) const { return {value * b.value, slope * b.value + value * b.slope}; }
    Dual operator/(const Dual& b) const { return {value / b.value, (slope - value / b.value * b.slope) / b.value}; }
};

template <>
struct Math<Dual> {
    using Plain = long double;
    static Plain value(const Dual& x) { return x.value; }
    static Dual exp(const Dual& a) { return {expl(a.value), a.slope == 0 ? 0 : expl(a.value) * a.slope}; }
    static Dual minus_expm1(const Dual& a) { return {-expm1l(a.value), a.slope == 0 ? 0 : -expl(a.value) * a.slope}; }
};

template <class S>
struct Ray {  // one value a sample (colours: one channel); heads that are off are left empty
    std::vector<S> delta, density_o, color_o, density_e, color_e, beta_density, beta_color;
    std::size_t size() const { return delta.size(); }
};

template <class S>
struct Values {
    using Plain = typename Math<S>::Plain;
    S color{0}, color_edit{0}, alpha_edit{0}, transmittance{1}, added{0}, removed{0}, changed{0};
    // Σ w · (1 + depth in front): what the kernel's relative error of each weight may add up to.
    Plain weight_bound{0}, removed_bound{0};
    std::vector<Plain> weight_o, weight_e, front;  // of each sample; front: Σ aᵝ before it
};

template <class S>
S clamped_depth(const S& density, const S& delta) {
    using M = Math<S>;
    if (std::isinf(static_cast<double>(M::value(density)))) return M::value(delta) == 0 ? S(0) : S(1e30L);
    const S depth = density * delta;
    return M::value(depth) >= 1e30L ? S(1e30L) : depth;
}

// φ(x) = (1 − e⁻ˣ)/x; below 1e-12 its series, to 50 digits.
template <class S>
S share(const S& x, const S& alpha) {
    if (Math<S>::value(x) >= 1e-12L) return alpha / x;
    return S(1) - x * S(0.5L) + x * x / S(6) - x * x * x / S(24) + x * x * x * x / S(120);
}

template <class S>
Values<S> blend(const BlendMode& mode, const Ray<S>& ray) {
    using M = Math<S>;
    Values<S> out;
    S front(0), front_kept(0), front_o(0), front_removed(0), removed(0), removed_scale(0);  // in front of sample k
    const S none(0), one(1);
    for (std::size_t k = 0; k < ray.size(); ++k) {
        const S ao = clamped_depth(ray.density_o[k], ray.delta[k]);
        const S beta_density = mode.remove ? ray.beta_density[k] : none, beta = mode.change ? ray.beta_color[k] : none;
        const S kept = (one - beta_density) * ao;
        const S ae = mode.add ? clamped_depth(ray.density_e[k], ray.delta[k]) : none;
        const S both = kept + ae, t = M::exp(none - front);
        S wo = none, we = none;
        if (mode.conserving) {
            const S part = share(both, M::minus_expm1(none - both));
            wo = t * kept * part;
            we = t * ae * part;
        } else {
            wo = t * M::minus_expm1(none - kept);
            we = t * M::minus_expm1(none - ae);
        }
        const bool colored = mode.add || mode.change;
        const S ce = colored ? ray.color_e[k] : none;
        const S blended = (one - beta) * ray.color_o[k] + beta * ce;
        out.color = out.color + wo * blended + we * ce;
        out.alpha_edit = out.alpha_edit + wo * beta + we;
        out.color_edit = out.color_edit + (wo * beta + we) * ce;
        out.added = out.added + we;
        out.changed = out.changed + wo * beta;
        out.weight_bound += (M::value(wo) + M::value(we)) * (1 + M::value(front));
        out.weight_o.push_back(M::value(wo));
        out.weight_e.push_back(M::value(we));
        out.front.push_back(M::value(front));
        if (mode.remove) {
            const S alpha_o = M::minus_expm1(none - ao);
            // `visible`: Tᵒ αᵒ βσ over Tᵒ αᵒ; as the paper has it: (Tᵒ' − Tᵒ) αᵒ over αᵒ.
            const S weight = mode.visible ? M::exp(none - front_o) * alpha_o : alpha_o;
            const S gone =
                mode.visible ? beta_density : M::exp(none - front_kept) * M::minus_expm1(none - front_removed);
            removed = removed + weight * gone;
            removed_scale = removed_scale + weight;
            out.removed_bound +=
                M::value(weight) * M::value(gone) * (1 + M::value(mode.visible ? front_o : front_kept));
        }
        front = front + both;
        front_kept = front_kept + kept;
        front_o = front_o + ao;
        front_removed = front_removed + beta_density * ao;
    }
    out.transmittance = M::exp(none - front);
    if (M::value(removed_scale) > 0) {
        out.removed = removed / removed_scale;
        out.removed_bound /= M::value(removed_scale);
    }
    return out;
}

}  // namespace fieldgraft::oracle
