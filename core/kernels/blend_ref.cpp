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

// A ray's samples, quantity by quantity, so that exponentials can be taken of many at once.
template <class Real, class M>
class RayTerms {
  public:
    std::vector<Real> depth_o, depth_kept, depth_e, depth;  // aᵒ, aᵒ', aᵉ, aᵝ
    std::vector<Real> unit_kept, unit_e, alpha_o;           // wᵒ/T, wᵉ/T, αᵒ
    std::vector<Real> transmittance;                        // Tᵝ in front of each sample, and past the last
    std::vector<Real> map;                                  // in front, for `removed`: Tᵒ' (paper) or Tᵒ (visible)
    std::vector<Real> uncovered;                            // Tᵒ' − Tᵒ in front (paper; forward only)
    std::vector<Real> through_kept, through_e;  // e^−aᵒ' and e^−aᵉ, or e^−aᵝ in the first (backward only)

    explicit RayTerms(const BlendMath<Real>& math) : math_(math) {}

    void set(const BlendInputs<Real>& in, std::int64_t r) {
        first_ = in.start[r];
        n_ = static_cast<std::size_t>(in.start[r + 1] - first_);
        set_depths(in);
        set_units();
        set_fronts(in);
    }
    std::size_t size() const { return n_; }

    void set_uncovered() {
        if constexpr (M::paper_map) {
            uncovered.resize(n_);
            math_.covered(front_removed_.data(), n_, uncovered.data());
            for (std::size_t i = 0; i < n_; ++i) uncovered[i] *= map[i];
        }
    }
    void set_through() {
        through_kept.resize(n_);
        through_e.resize(n_);
        math_.passed(M::conserving ? depth.data() : depth_kept.data(), n_, through_kept.data());
        if constexpr (M::add && !M::conserving) math_.passed(depth_e.data(), n_, through_e.data());
    }

  private:
    void set_depths(const BlendInputs<Real>& in) {
        for (auto* part : {&depth_o, &depth_kept, &depth_e, &depth}) part->resize(n_);
        for (std::size_t i = 0; i < n_; ++i) {
            const std::int64_t k = first_ + static_cast<std::int64_t>(i);
            depth_o[i] = depth_kept[i] = optical_depth(in.density_o[k], in.delta[k]);
            if constexpr (M::remove) depth_kept[i] = (Real(1) - in.beta_density[k]) * depth_o[i];
            if constexpr (M::add) depth_e[i] = optical_depth(in.density_e[k], in.delta[k]);
            depth[i] = M::add ? depth_kept[i] + depth_e[i] : depth_kept[i];
        }
    }
    void set_units() {
        for (auto* part : {&unit_kept, &unit_e, &alpha_o}) part->resize(n_);
        if constexpr (M::conserving) {
            math_.covered(depth.data(), n_, unit_kept.data());
            for (std::size_t i = 0; i < n_; ++i) {
                const Real share = depth[i] < Real(1e-30) ? Real(1) : unit_kept[i] / depth[i];  // φ
                unit_kept[i] = depth_kept[i] * share;
                unit_e[i] = depth_e[i] * share;
            }
        } else {
            math_.covered(depth_kept.data(), n_, unit_kept.data());
            if constexpr (M::add) math_.covered(depth_e.data(), n_, unit_e.data());
        }
        if constexpr (M::remove) math_.covered(depth_o.data(), n_, alpha_o.data());
    }
    // What lies in front of each sample, summed in double, and the transmittances that gives.
    void set_fronts(const BlendInputs<Real>& in) {
        transmittance.resize(n_ + 1);
        map.resize(n_);
        front_removed_.resize(n_);
        Sum all = 0, kept = 0, removed = 0, of_o = 0;
        for (std::size_t i = 0; i < n_; ++i) {
            transmittance[i] = Real(all);
            if constexpr (M::paper_map) {
                map[i] = Real(M::add ? kept : all);  // Tᵒ' = Tᵝ where nothing is added
                front_removed_[i] = Real(removed);
                kept += depth_kept[i];
                removed += in.beta_density[first_ + static_cast<std::int64_t>(i)] * depth_o[i];
            }
            if constexpr (M::visible_map) {
                map[i] = Real(of_o);
                of_o += depth_o[i];
            }
            all += depth[i];
        }
        transmittance[n_] = Real(all);
        math_.passed(transmittance.data(), n_ + 1, transmittance.data());
        if constexpr (M::remove) math_.passed(map.data(), n_, map.data());
    }

    const BlendMath<Real>& math_;
    std::int64_t first_ = 0;
    std::size_t n_ = 0;
    std::vector<Real> front_removed_;
};

// Derivatives of x·unit_kept + y·unit_e by depth_kept and by depth_e.
template <class Real, class M>
struct UnitSlopes {
    Real depth_kept, depth_e, depth;
    Real through_kept, through_e;
    Real share = 0, slope_or_through = 0;  // conserving: φ, and φ' (thin) or e⁻ˣ (thick)
    bool thin = false;

    UnitSlopes(const RayTerms<Real, M>& s, std::size_t i)
        : depth_kept(s.depth_kept[i]),
          depth_e(s.depth_e[i]),
          depth(s.depth[i]),
          through_kept(s.through_kept[i]),
          through_e(s.through_e[i]) {
        if constexpr (M::conserving) {
            share = phi(depth);
            thin = depth < Real(0.5);
            slope_or_through = thin ? phi_derivative(depth) : through_kept;
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

template <class Real>
void store3(Real* to, const Sum* from) {
    for (int c = 0; c < 3; ++c) to[c] = Real(from[c]);
}

// What forward sums along one ray.
template <class Real, class M>
struct RaySums {
    Sum color[3] = {}, color_edit[3] = {};
    Sum alpha_edit = 0, added = 0, changed = 0, removed = 0, removed_scale = 0;

    void accumulate(const BlendInputs<Real>& in, std::int64_t k, const RayTerms<Real, M>& s, std::size_t i) {
        const Real t = s.transmittance[i], kept = t * s.unit_kept[i], edit = t * s.unit_e[i];
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
        if constexpr (M::remove) accumulate_removed(in.beta_density[k], s, i);
    }

    void accumulate_removed(Real beta, const RayTerms<Real, M>& s, std::size_t i) {
        if constexpr (M::paper_map) {
            removed += Sum(s.uncovered[i]) * s.alpha_o[i];  // the product may be below the smallest float
            removed_scale += s.alpha_o[i];
        } else {
            const Sum weight = Sum(s.map[i]) * s.alpha_o[i];
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
void forward_rays(const BlendInputs<Real>& in, const BlendRays<Real>& out, std::int64_t begin, std::int64_t end,
                  const BlendMath<Real>& math) {
    RayTerms<Real, M> terms(math);
    for (std::int64_t r = begin; r < end; ++r) {
        RaySums<Real, M> sums;
        terms.set(in, r);
        terms.set_uncovered();
        for (std::size_t i = 0; i < terms.size(); ++i)
            sums.accumulate(in, in.start[r] + static_cast<std::int64_t>(i), terms, i);
        sums.store(out, r, terms.transmittance[terms.size()]);
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

// Σ αᵒ (paper) or Σ Tᵒ αᵒ (visible).
template <class Real, class M>
Sum removed_scale_of(const RayTerms<Real, M>& s) {
    Sum scale = 0;
    for (std::size_t i = 0; i < s.size() && M::remove; ++i)
        scale += M::paper_map ? Sum(s.alpha_o[i]) : Sum(s.map[i]) * s.alpha_o[i];
    return scale;
}

// Sums over the samples behind the one at hand.
struct Behind {
    Sum light = 0;      // of what flows everywhere: −∂L/∂(depth in front)
    Sum added = 0;      // of the gradient of `added`
    Sum uncovered = 0;  // Σ Tᵒ' αᵒ
};

template <class Real, class M>
void backward_sample(const BlendInputs<Real>& in, const BlendHeads<Real>& out, std::int64_t k,
                     const RayGradient<Real>& g, const RayTerms<Real, M>& s, std::size_t i, Sum removed_scale,
                     Behind& behind) {
    const UnitSlopes<Real, M> slopes(s, i);
    const Real t = s.transmittance[i], kept = t * s.unit_kept[i], edit = t * s.unit_e[i];
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
            to_map = M::paper_map ? s.depth_o[i] * (behind.uncovered / removed_scale)
                                  : Sum(s.map[i]) * s.alpha_o[i] / removed_scale;
        }
        out.beta_density[k] = Real(g.removed * to_map) - s.depth_o[i] * to_depth;
        if constexpr (M::paper_map) behind.uncovered += Sum(s.map[i]) * s.alpha_o[i];
    }
    if constexpr (M::add) {
        const Sum to_depth = t * slopes.by_e(by_kept, by_e + g.added) - behind.light - behind.added;
        out.density_e[k] = s.depth_e[i] < depth_limit<Real> ? in.delta[k] * Real(to_depth) : Real(0);
        behind.added += edit * g.added;
    }
    behind.light += kept * by_kept + edit * by_e;
}

template <class Real, class M>
void backward_rays(const BlendInputs<Real>& in, const BlendRays<const Real>& grad, const BlendHeads<Real>& out,
                   std::int64_t begin, std::int64_t end, const BlendMath<Real>& math) {
    RayTerms<Real, M> terms(math);
    for (std::int64_t r = begin; r < end; ++r) {
        terms.set(in, r);
        terms.set_through();
        const Sum removed_scale = removed_scale_of(terms);
        const RayGradient<Real> g(grad, r);
        Behind behind;
        behind.light = Sum(g.transmittance) * terms.transmittance[terms.size()];
        for (std::size_t i = terms.size(); i-- > 0;) {
            backward_sample<Real, M>(in, out, in.start[r] + static_cast<std::int64_t>(i), g, terms, i, removed_scale,
                                     behind);
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
const BlendMath<Real>& library_math() {
    static const BlendMath<Real> math{[](const Real* x, std::size_t n, Real* out) {
                                          for (std::size_t i = 0; i < n; ++i) out[i] = std::exp(-x[i]);
                                      },
                                      [](const Real* x, std::size_t n, Real* out) {
                                          for (std::size_t i = 0; i < n; ++i) out[i] = -std::expm1(-x[i]);
                                      }};
    return math;
}

template <class Real>
void blend_forward(const BlendMode& mode, const BlendInputs<Real>& in, const BlendRays<Real>& out,
                   std::int64_t ray_begin, std::int64_t ray_end, const BlendMath<Real>& math) {
    with_mode(mode, [&](auto m) { forward_rays<Real, decltype(m)>(in, out, ray_begin, ray_end, math); });
}

template <class Real>
void blend_backward(const BlendMode& mode, const BlendInputs<Real>& in, const BlendRays<const Real>& grad,
                    const BlendHeads<Real>& out, std::int64_t ray_begin, std::int64_t ray_end,
                    const BlendMath<Real>& math) {
    with_mode(mode, [&](auto m) { backward_rays<Real, decltype(m)>(in, grad, out, ray_begin, ray_end, math); });
}

template const BlendMath<float>& library_math<float>();
template void blend_forward<float>(const BlendMode&, const BlendInputs<float>&, const BlendRays<float>&, std::int64_t,
                                   std::int64_t, const BlendMath<float>&);
template void blend_backward<float>(const BlendMode&, const BlendInputs<float>&, const BlendRays<const float>&,
                                    const BlendHeads<float>&, std::int64_t, std::int64_t, const BlendMath<float>&);
template const BlendMath<double>& library_math<double>();
template void blend_forward<double>(const BlendMode&, const BlendInputs<double>&, const BlendRays<double>&,
                                    std::int64_t, std::int64_t, const BlendMath<double>&);
template void blend_backward<double>(const BlendMode&, const BlendInputs<double>&, const BlendRays<const double>&,
                                     const BlendHeads<double>&, std::int64_t, std::int64_t, const BlendMath<double>&);

}  // namespace fieldgraft
