// Rays for the tests of the blended kernels: storage, the modes, and calls of forward and backward.
#pragma once

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "core/kernels/blend_ref.h"
#include "tests/kernels/blend_oracle.h"

namespace fieldgraft {

inline std::vector<BlendMode> all_modes() {
    std::vector<BlendMode> modes;
    for (int ops = 1; ops < 8; ++ops) {
        for (int rules = 0; rules < 4; ++rules) {
            modes.push_back({(ops & 1) != 0, (ops & 2) != 0, (ops & 4) != 0, (rules & 1) != 0, (rules & 2) != 0});
        }
    }
    return modes;
}

inline std::string name_of(const BlendMode& mode) {
    std::string name;
    if (mode.add) name += "add ";
    if (mode.remove) name += "remove ";
    if (mode.change) name += "change ";
    return name + (mode.conserving ? "conserving " : "paper ") + (mode.visible ? "visible" : "removed-as-paper");
}

template <class Real>
struct Rays {  // R rays and their samples; every head has values, those that a mode lacks are not passed on
    std::vector<std::int64_t> start{0};
    std::vector<Real> delta, density_o, color_o, density_e, color_e, beta_density, beta_color;

    void add_sample(Real d, Real so, Real co, Real se, Real ce, Real bd, Real bc) {
        delta.push_back(d);
        density_o.push_back(so);
        density_e.push_back(se);
        beta_density.push_back(bd);
        beta_color.push_back(bc);
        for (int c = 0; c < 3; ++c) {  // three different channels
            color_o.push_back(co * Real(1 - 0.25 * c));
            color_e.push_back(ce * Real(1 - 0.125 * c));
        }
    }
    void end_ray() { start.push_back(static_cast<std::int64_t>(delta.size())); }
    std::int64_t rays() const { return static_cast<std::int64_t>(start.size()) - 1; }

    BlendInputs<Real> inputs(const BlendMode& mode) const {
        BlendInputs<Real> in{start.data(), delta.data(), density_o.data(), color_o.data(),
                             nullptr,      nullptr,      nullptr,          nullptr};
        if (mode.add) in.density_e = density_e.data();
        if (mode.add || mode.change) in.color_e = color_e.data();
        if (mode.remove) in.beta_density = beta_density.data();
        if (mode.change) in.beta_color = beta_color.data();
        return in;
    }
    std::vector<Real>& head(int index) {
        return *std::array<std::vector<Real>*, 4>{&density_e, &color_e, &beta_density, &beta_color}[index];
    }
};

inline bool has_head(const BlendMode& mode, int index) {
    return std::array{mode.add, mode.add || mode.change, mode.remove, mode.change}[index];
}

template <class Real>
struct RayValues {  // outputs, or their gradients: 11 numbers a ray
    std::vector<Real> color, transmittance, color_edit, alpha_edit, added, removed, changed;
    explicit RayValues(std::int64_t rays, Real value = 0)
        : color(3 * rays, value),
          transmittance(rays, value),
          color_edit(3 * rays, value),
          alpha_edit(rays, value),
          added(rays, value),
          removed(rays, value),
          changed(rays, value) {}
    BlendRays<Real> pointers() {
        return {color.data(), transmittance.data(), color_edit.data(), alpha_edit.data(),
                added.data(), removed.data(),       changed.data()};
    }
    std::vector<std::vector<Real>*> all() {
        return {&color, &transmittance, &color_edit, &alpha_edit, &added, &removed, &changed};
    }
};

template <class Real>
RayValues<Real> forward(const BlendMode& mode, const Rays<Real>& rays,
                        const BlendMath<Real>& math = library_math<Real>()) {
    RayValues<Real> out(rays.rays());
    blend_forward(mode, rays.inputs(mode), out.pointers(), 0, rays.rays(), math);
    return out;
}

template <class Real>
std::array<std::vector<Real>, 4> backward(const BlendMode& mode, const Rays<Real>& rays, RayValues<Real> grads,
                                          const BlendMath<Real>& math = library_math<Real>()) {
    std::array<std::vector<Real>, 4> heads;
    const std::size_t n = rays.delta.size();
    for (int i = 0; i < 4; ++i) heads[i].assign(i == 1 ? 3 * n : n, Real(12345));  // what kernels must overwrite
    const BlendRays<const Real> in{grads.color.data(),      grads.transmittance.data(), grads.color_edit.data(),
                                   grads.alpha_edit.data(), grads.added.data(),         grads.removed.data(),
                                   grads.changed.data()};
    blend_backward(mode, rays.inputs(mode), in, {heads[0].data(), heads[1].data(), heads[2].data(), heads[3].data()}, 0,
                   rays.rays(), math);
    return heads;
}

// Ray r, channel c, for the oracle in the numbers S.
template <class S = oracle::Dual, class Real>
oracle::Ray<S> oracle_ray(const Rays<Real>& rays, std::int64_t r, int channel) {
    oracle::Ray<S> ray;
    for (std::int64_t k = rays.start[r]; k < rays.start[r + 1]; ++k) {
        ray.delta.push_back(S(rays.delta[k]));
        ray.density_o.push_back(S(rays.density_o[k]));
        ray.color_o.push_back(S(rays.color_o[3 * k + channel]));
        ray.density_e.push_back(S(rays.density_e[k]));
        ray.color_e.push_back(S(rays.color_e[3 * k + channel]));
        ray.beta_density.push_back(S(rays.beta_density[k]));
        ray.beta_color.push_back(S(rays.beta_color[k]));
    }
    return ray;
}

// Rays of 0, 1, 2, 7 and 31 samples with moderate values.
inline Rays<double> random_rays(unsigned seed) {
    std::mt19937 engine(seed);
    std::uniform_real_distribution<double> u(0.05, 0.95);
    Rays<double> rays;
    for (const int size : {0, 1, 2, 7, 31}) {
        for (int k = 0; k < size; ++k)
            rays.add_sample(0.2 * u(engine), 4 * u(engine), u(engine), 3 * u(engine), u(engine), u(engine), u(engine));
        rays.end_ray();
    }
    return rays;
}

}  // namespace fieldgraft
