// The blended equations written down once more, directly and in long double, for the tests of the kernels: plain sums
// over the samples of one ray, no recurrences. With Dual it also gives derivatives by one input (forward mode).
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/kernels/blend_ref.h"

namespace fieldgraft::oracle {

struct Dual {
    long double value = 0, slope = 0;
    Dual(long double v = 0, long double s = 0) : value(v), slope(s) {}
    Dual operator+(const Dual& b) const { return {value + b.value, slope + b.slope}; }
    Dual operator-(const Dual& b) const { return {value - b.value, slope - b.slope}; }
    Dual operator*(const Dual& b) const { return {value * b.value, slope * b.value + value * b.slope}; }
    Dual operator/(const Dual& b) const { return {value / b.value, (slope - value / b.value * b.slope) / b.value}; }
};
inline Dual exponential(const Dual& a) {
    return {expl(a.value), a.slope == 0 ? 0 : expl(a.value) * a.slope};
}
inline Dual minus_expm1(const Dual& a) {
    return {-expm1l(a.value), a.slope == 0 ? 0 : -expl(a.value) * a.slope};
}

template <class S>
struct Ray {  // one value a sample (colours: one channel); heads that are off are left empty
    std::vector<S> delta, density_o, color_o, density_e, color_e, beta_density, beta_color;
    std::size_t size() const { return delta.size(); }
};

struct Values {
    Dual color, color_edit, alpha_edit, transmittance = 1, added, removed, changed;
    // Σ w · (1 + depth in front): what the kernel's relative error of each weight may add up to.
    long double weight_bound = 0, removed_bound = 0;
};

inline Dual clamped_depth(const Dual& density, const Dual& delta) {
    if (std::isinf(static_cast<double>(density.value))) return delta.value == 0 ? 0 : 1e30L;
    const Dual depth = density * delta;
    return depth.value >= 1e30L ? Dual(1e30L) : depth;
}

inline Values blend(const BlendMode& mode, const Ray<Dual>& ray) {
    Values out;
    Dual front, front_kept, front_o, front_removed, removed, removed_scale;  // depths in front of sample k
    for (std::size_t k = 0; k < ray.size(); ++k) {
        const Dual ao = clamped_depth(ray.density_o[k], ray.delta[k]);
        const Dual beta_density = mode.remove ? ray.beta_density[k] : Dual(),
                   beta = mode.change ? ray.beta_color[k] : Dual();
        const Dual kept = (Dual(1) - beta_density) * ao;
        const Dual ae = mode.add ? clamped_depth(ray.density_e[k], ray.delta[k]) : Dual();
        const Dual both = kept + ae, t = exponential(Dual() - front);
        Dual wo = t * minus_expm1(Dual() - kept), we = t * minus_expm1(Dual() - ae);
        if (mode.conserving) {
            const Dual alpha = minus_expm1(Dual() - both);
            const bool tiny = both.value < 1e-15L;  // φ = 1 − x/2 there, to all digits of long double
            wo = tiny ? t * kept * (Dual(1) - both * 0.5L) : t * alpha * (kept / both);
            we = tiny ? t * ae * (Dual(1) - both * 0.5L) : t * alpha * (ae / both);
        }
        const bool colored = mode.add || mode.change;
        const Dual ce = colored ? ray.color_e[k] : Dual();
        const Dual blended = (Dual(1) - beta) * ray.color_o[k] + beta * ce;
        out.color = out.color + wo * blended + we * ce;
        out.alpha_edit = out.alpha_edit + wo * beta + we;
        out.color_edit = out.color_edit + (wo * beta + we) * ce;
        out.added = out.added + we;
        out.changed = out.changed + wo * beta;
        out.weight_bound += (wo.value + we.value) * (1 + front.value);
        const Dual alpha_o = minus_expm1(Dual() - ao);
        if (mode.remove && mode.visible) {
            const Dual w = exponential(Dual() - front_o) * alpha_o;
            removed = removed + w * beta_density;
            removed_scale = removed_scale + w;
            out.removed_bound += w.value * beta_density.value * (1 + front_o.value);
        } else if (mode.remove) {
            const Dual uncovered = exponential(Dual() - front_kept) * minus_expm1(Dual() - front_removed);
            removed = removed + uncovered * alpha_o;
            removed_scale = removed_scale + alpha_o;
            out.removed_bound += uncovered.value * alpha_o.value * (1 + front_kept.value);
        }
        front = front + both;
        front_kept = front_kept + kept;
        front_o = front_o + ao;
        front_removed = front_removed + beta_density * ao;
    }
    out.transmittance = exponential(Dual() - front);
    if (removed_scale.value > 0) {
        out.removed = removed / removed_scale;
        out.removed_bound /= removed_scale.value;
    }
    return out;
}

}  // namespace fieldgraft::oracle
