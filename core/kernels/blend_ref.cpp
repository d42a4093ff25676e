#include "core/kernels/blend_ref.h"

#include <cassert>
#include <cmath>
#include <limits>
#include <type_traits>
#include <vector>

#include "core/kernels/phi.h"

namespace fieldgraft {
namespace {

using Sum = double;  // what is summed over a ray

template <class Real>
constexpr Real depth_limit = Real(1e30);

// σδ, clamped; an infinite density over an empty interval is 0, NaN stays NaN.
template <class Real>
inline Real optical_depth(Real density, Real delta) {
    constexpr Real largest = std::numeric_limits<Real>::max();
    const Real depth = (density > largest ? largest : density) * delta;
    return depth > depth_limit<Real> ? depth_limit<Real> : depth;
}

template <class Real>
inline Real dot3(const Real* a, const Real* b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// The compile-time form of BlendMode.
template <bool Add, bool Remove, bool Change, bool Conserving, bool Visible>
struct Mode {
    static constexpr bool add = Add, remove = Remove, change = Change, conserving = Conserving, visible = Visible;
    static constexpr bool colors = Add || Change;          // there is a cᵉ
    static constexpr bool paper_map = Remove && !Visible;  // `removed` as the paper has it
    static constexpr bool visible_map = Remove && Visible;
};

// One sample's optical depths and its weights before the transmittance in front of it (u = w/T).
template <class Real, class M>
struct Sample {
    Real depth_o, depth_kept, depth_e = 0;  // aᵒ, aᵒ', aᵉ
    Real unit_kept, unit_e = 0;             // wᵒ/T, wᵉ/T

    Sample(const BlendInputs<Real>& in, std::int64_t k) {
        depth_o = depth_kept = optical_depth(in.density_o[k], in.delta[k]);
        if constexpr (M::remove) depth_kept = (Real(1) - in.beta_density[k]) * depth_o;
        if constexpr (M::add) depth_e = optical_depth(in.density_e[k], in.delta[k]);
        if constexpr (M::conserving) {
            const Real share = phi(depth());
            unit_kept = depth_kept * share;
            unit_e = depth_e * share;
        } else {
            unit_kept = -std::expm1(-depth_kept);
            if constexpr (M::add) unit_e = -std::expm1(-depth_e);
        }
    }
    Real depth() const { return M::add ? depth_kept + depth_e : depth_kept; }
    Real alpha_o() const { return M::remove ? -std::expm1(-depth_o) : unit_kept; }
};

// Derivatives of x·unit_kept + y·unit_e by depth_kept and by depth_e.
template <class Real, class M>
struct UnitSlopes {
    Real depth_kept, depth_e, depth;
    Real through_kept = 0, through_e = 0;  // paper
    Real share = 0, slope_or_through = 0;  // conserving: φ, and φ' (thin) or e⁻ˣ (thick)
    bool thin = false;

    explicit UnitSlopes(const Sample<Real, M>& s) : depth_kept(s.depth_kept), depth_e(s.depth_e), depth(s.depth()) {
        if constexpr (M::conserving) {
            share = phi(depth);
            thin = depth < Real(0.5);
            slope_or_through = thin ? phi_derivative(depth) : std::exp(-depth);
        } else {
            through_kept = std::exp(-depth_kept);
            if constexpr (M::add) through_e = std::exp(-depth_e);
        }
    }
    Real by_kept(Real x, Real y) const {
        if constexpr (!M::conserving) return through_kept * x;
        if (thin) return share * x + slope_or_through * (depth_kept * x + depth_e * y);
        return depth_e / depth * share * (x - y) + mixed(x, y);
    }
    Real by_e(Real x, Real y) const {
        if constexpr (!M::conserving) return through_e * y;
        if (thin) return share * y + slope_or_through * (depth_kept * x + depth_e * y);
        return depth_kept / depth * share * (y - x) + mixed(x, y);
    }

  private:
    // depth·φ' = e⁻ˣ − φ has been put in above: a φ' + φ cancels where one medium is all there is.
    Real mixed(Real x, Real y) const { return slope_or_through * (depth_kept / depth * x + depth_e / depth * y); }
};

// Depths in front of the sample at hand, and the transmittances they give.
template <class Real, class M>
struct Front {
    Sum depth = 0, depth_kept = 0, depth_removed = 0, depth_o = 0;

    void pass(const Sample<Real, M>& s, Real beta_density) {
        depth += s.depth();
        if constexpr (M::paper_map) {
            if constexpr (M::add) depth_kept += s.depth_kept;
            depth_removed += beta_density * s.depth_o;
        }
        if constexpr (M::visible_map) depth_o += s.depth_o;
    }
    Real transmittance() const { return std::exp(-Real(depth)); }
    Real transmittance_o() const { return std::exp(-Real(depth_o)); }
    // Tᵒ' = Tᵝ where nothing is added.
    Real transmittance_kept() const { return std::exp(-Real(M::add ? depth_kept : depth)); }
    // Tᵒ' − Tᵒ without cancellation.
    Real uncovered() const { return -transmittance_kept() * std::expm1(-Real(depth_removed)); }
};

template <class Real, class M>
Real beta_density(const BlendInputs<Real>& in, std::int64_t k) {
    if constexpr (M::remove) return in.beta_density[k];
    return 0;
}

template <class Real>
void store3(Real* to, const Sum* from) {
    for (int c = 0; c < 3; ++c) to[c] = Real(from[c]);
}

// What forward sums along one ray.
template <class Real, class M>
struct RaySums {
    Sum color[3] = {}, color_edit[3] = {};
    Sum alpha_edit = 0, added = 0, changed = 0, removed = 0, removed_scale = 0;

    void accumulate(const BlendInputs<Real>& in, std::int64_t k, const Sample<Real, M>& s,
                    const Front<Real, M>& front) {
        const Real t = front.transmittance(), kept = t * s.unit_kept, edit = t * s.unit_e;
        const Real* color_o = in.color_o + 3 * k;
        const Real beta = [&] {
            if constexpr (M::change) return in.beta_color[k];
            return Real(0);
        }();
        const Real weight_edit = M::change ? kept * beta + edit : edit;
        for (int c = 0; c < 3; ++c) {
            if constexpr (M::colors) {
                const Real color_e = in.color_e[3 * k + c];
                const Real blended = M::change ? (Real(1) - beta) * color_o[c] + beta * color_e : color_o[c];
                color[c] += M::add ? kept * blended + edit * color_e : kept * blended;
                color_edit[c] += weight_edit * color_e;
            } else {
                color[c] += kept * color_o[c];
            }
        }
        if constexpr (M::colors) alpha_edit += weight_edit;
        if constexpr (M::add) added += edit;
        if constexpr (M::change) changed += kept * beta;
        if constexpr (M::remove) accumulate_removed(in.beta_density[k], s, front);
    }

    void accumulate_removed(Real beta, const Sample<Real, M>& s, const Front<Real, M>& front) {
        if constexpr (M::paper_map) {
            removed += Sum(front.uncovered()) * s.alpha_o();  // the product may be below the smallest float
            removed_scale += s.alpha_o();
        } else {
            const Sum weight = Sum(front.transmittance_o()) * s.alpha_o();
            removed += weight * beta;
            removed_scale += weight;
        }
    }

    void store(const BlendRays<Real>& out, std::int64_t r, Real transmittance) const {
        store3(out.color + 3 * r, color);
        out.transmittance[r] = transmittance;
        if constexpr (M::colors) {
            store3(out.color_edit + 3 * r, color_edit);
            out.alpha_edit[r] = Real(alpha_edit);
        }
        if constexpr (M::add) out.added[r] = Real(added);
        if constexpr (M::change) out.changed[r] = Real(changed);
        if constexpr (M::remove) out.removed[r] = removed_scale > 0 ? Real(removed / removed_scale) : Real(0);
    }
};

template <class Real, class M>
void forward_rays(const BlendInputs<Real>& in, const BlendRays<Real>& out, std::int64_t begin, std::int64_t end) {
    for (std::int64_t r = begin; r < end; ++r) {
        RaySums<Real, M> sums;
        Front<Real, M> front;
        for (std::int64_t k = in.start[r]; k < in.start[r + 1]; ++k) {
            const Sample<Real, M> s(in, k);
            sums.accumulate(in, k, s, front);
            front.pass(s, beta_density<Real, M>(in, k));
        }
        sums.store(out, r, front.transmittance());
    }
}

// The incoming gradients of one ray; absent ones are 0.
template <class Real>
struct RayGradient {
    Real color[3] = {}, color_edit[3] = {}, alpha_edit = 0, transmittance = 0, added = 0, removed = 0, changed = 0;

    RayGradient(const BlendRays<const Real>& grad, std::int64_t r) {
        for (int c = 0; c < 3; ++c) {
            if (grad.color) color[c] = grad.color[3 * r + c];
            if (grad.color_edit) color_edit[c] = grad.color_edit[3 * r + c];
        }
        if (grad.alpha_edit) alpha_edit = grad.alpha_edit[r];
        if (grad.transmittance) transmittance = grad.transmittance[r];
        if (grad.added) added = grad.added[r];
        if (grad.removed) removed = grad.removed[r];
        if (grad.changed) changed = grad.changed[r];
    }
};

// Transmittances in front of each sample of a ray, kept for the way back.
template <class Real>
struct Passed {
    Real transmittance;  // Tᵝ
    Real map;            // Tᵒ' (paper) or Tᵒ (visible), for `removed`
};

template <class Real, class M>
struct RayForward {
    Real transmittance = 1;  // past the last sample
    Sum removed_scale = 0;

    RayForward(const BlendInputs<Real>& in, std::int64_t r, std::vector<Passed<Real>>& passed) {
        passed.clear();
        Front<Real, M> front;
        for (std::int64_t k = in.start[r]; k < in.start[r + 1]; ++k) {
            const Sample<Real, M> s(in, k);
            const Real map = M::paper_map     ? front.transmittance_kept()
                             : M::visible_map ? front.transmittance_o()
                                              : Real(0);
            if constexpr (M::paper_map) removed_scale += s.alpha_o();
            if constexpr (M::visible_map) removed_scale += Sum(map) * s.alpha_o();
            passed.push_back({front.transmittance(), map});
            front.pass(s, beta_density<Real, M>(in, k));
        }
        transmittance = front.transmittance();
    }
};

// Sums over the samples behind the one at hand.
struct Behind {
    Sum light = 0;      // of what flows everywhere: −∂L/∂(depth in front)
    Sum added = 0;      // of the gradient of `added`
    Sum uncovered = 0;  // Σ Tᵒ' αᵒ
};

template <class Real, class M>
void backward_sample(const BlendInputs<Real>& in, const BlendHeads<Real>& out, std::int64_t k,
                     const RayGradient<Real>& g, const Passed<Real>& passed, Sum removed_scale, Behind& behind) {
    const Sample<Real, M> s(in, k);
    const UnitSlopes<Real, M> slopes(s);
    const Real t = passed.transmittance, kept = t * s.unit_kept, edit = t * s.unit_e;
    const Real* color_o = in.color_o + 3 * k;
    // by_kept, by_e: what a unit of wᵒ, of wᵉ is worth.
    Real by_kept = dot3(g.color, color_o), by_e = 0;
    if constexpr (M::colors) {
        const Real* color_e = in.color_e + 3 * k;
        const Real of_edit = dot3(g.color_edit, color_e) + g.alpha_edit, of_color = dot3(g.color, color_e);
        by_e = of_color + of_edit;
        Real share = edit;
        if constexpr (M::change) {
            const Real beta = in.beta_color[k];
            out.beta_color[k] = kept * (by_e - by_kept + g.changed);
            by_kept = (Real(1) - beta) * by_kept + beta * by_e;
            share += kept * beta;
        }
        for (int c = 0; c < 3; ++c) out.color_e[3 * k + c] = share * (g.color[c] + g.color_edit[c]);
    }
    if constexpr (M::remove) {
        const Real to_depth = Real(t * slopes.by_kept(by_kept, by_e) - behind.light);
        Sum to_map = 0;
        if (removed_scale > 0) {
            to_map = M::paper_map ? s.depth_o * (behind.uncovered / removed_scale)
                                  : Sum(passed.map) * s.alpha_o() / removed_scale;
        }
        out.beta_density[k] = Real(g.removed * to_map) - s.depth_o * to_depth;
        if constexpr (M::paper_map) behind.uncovered += Sum(passed.map) * s.alpha_o();
    }
    if constexpr (M::add) {
        const Sum to_depth = t * slopes.by_e(by_kept, by_e + g.added) - behind.light - behind.added;
        out.density_e[k] = s.depth_e < depth_limit<Real> ? in.delta[k] * Real(to_depth) : Real(0);
        behind.added += edit * g.added;
    }
    behind.light += kept * by_kept + edit * by_e;
}

template <class Real, class M>
void backward_rays(const BlendInputs<Real>& in, const BlendRays<const Real>& grad, const BlendHeads<Real>& out,
                   std::int64_t begin, std::int64_t end) {
    std::vector<Passed<Real>> passed;
    for (std::int64_t r = begin; r < end; ++r) {
        const RayForward<Real, M> ray(in, r, passed);
        const RayGradient<Real> g(grad, r);
        Behind behind;
        behind.light = Sum(g.transmittance) * ray.transmittance;
        for (std::int64_t k = in.start[r + 1] - 1; k >= in.start[r]; --k) {
            backward_sample<Real, M>(in, out, k, g, passed[k - in.start[r]], ray.removed_scale, behind);
        }
    }
}

template <class F>
void with_bool(bool value, F&& f) {
    value ? f(std::true_type{}) : f(std::false_type{});
}

// Calls f(Mode<…>{}) for the mode; rules that a mode cannot tell apart share one specialisation.
template <class F>
void with_mode(const BlendMode& mode, F&& f) {
    assert(mode.add || mode.remove || mode.change);
    with_bool(mode.add, [&](auto add) {
        with_bool(mode.remove, [&](auto remove) {
            with_bool(mode.change, [&](auto change) {
                with_bool(mode.conserving && mode.add, [&](auto conserving) {
                    with_bool(mode.visible && mode.remove, [&](auto visible) {
                        constexpr bool any = add || remove || change;
                        if constexpr (any && (!conserving || add) && (!visible || remove)) {
                            f(Mode<add, remove, change, conserving, visible>{});
                        }
                    });
                });
            });
        });
    });
}

}  // namespace

template <class Real>
void blend_forward(const BlendMode& mode, const BlendInputs<Real>& in, const BlendRays<Real>& out,
                   std::int64_t ray_begin, std::int64_t ray_end) {
    with_mode(mode, [&](auto m) { forward_rays<Real, decltype(m)>(in, out, ray_begin, ray_end); });
}

template <class Real>
void blend_backward(const BlendMode& mode, const BlendInputs<Real>& in, const BlendRays<const Real>& grad,
                    const BlendHeads<Real>& out, std::int64_t ray_begin, std::int64_t ray_end) {
    with_mode(mode, [&](auto m) { backward_rays<Real, decltype(m)>(in, grad, out, ray_begin, ray_end); });
}

template void blend_forward<float>(const BlendMode&, const BlendInputs<float>&, const BlendRays<float>&, std::int64_t,
                                   std::int64_t);
template void blend_forward<double>(const BlendMode&, const BlendInputs<double>&, const BlendRays<double>&,
                                    std::int64_t, std::int64_t);
template void blend_backward<float>(const BlendMode&, const BlendInputs<float>&, const BlendRays<const float>&,
                                    const BlendHeads<float>&, std::int64_t, std::int64_t);
template void blend_backward<double>(const BlendMode&, const BlendInputs<double>&, const BlendRays<const double>&,
                                     const BlendHeads<double>&, std::int64_t, std::int64_t);

}  // namespace fieldgraft
