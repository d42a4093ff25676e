// Rays for the property tests: RapidCheck draws them, and shortens them when something fails.
#pragma once

#include <rapidcheck.h>

#include <cmath>
#include <limits>

#include "tests/kernels/blend_cases.h"

namespace fieldgraft::stability {

// Densities from nothing to infinity, most of them between 1e-12 and 1e4.
inline rc::Gen<float> any_density() {
    return rc::gen::oneOf(
        rc::gen::map(rc::gen::inRange(-1200, 401), [](int e) { return std::pow(10.0f, static_cast<float>(e) / 100); }),
        rc::gen::map(rc::gen::inRange(-100, 101), [](int e) { return std::pow(10.0f, static_cast<float>(e) / 100); }),
        rc::gen::element(0.0f, 1e-38f, 1e30f, std::numeric_limits<float>::infinity()));
}
// As above, but never so dense that depths are clamped.
inline rc::Gen<float> finite_density() {
    return rc::gen::map(any_density(), [](float density) { return std::min(density, 1e20f); });
}
inline rc::Gen<float> moderate_density() {
    return rc::gen::map(rc::gen::inRange(0, 300), [](int e) { return static_cast<float>(e) / 100; });
}
inline rc::Gen<float> any_share() {
    return rc::gen::oneOf(rc::gen::map(rc::gen::inRange(0, 1001), [](int i) { return static_cast<float>(i) / 1000; }),
                          rc::gen::element(0.0f, 1e-8f, 1 - 1e-7f, 1.0f));
}

struct DrawnRays {
    Rays<float> rays;
    float depth = 0;  // the largest Σ (aᵒ + aᵉ) of a ray, at most 1e30
};

// One to three rays of up to 24 samples each; `lengths`: multiples of 1/64, 0 among them.
inline DrawnRays draw_rays(const rc::Gen<float>& density, int rays = 3) {
    DrawnRays drawn;
    const int count = *rc::gen::inRange(1, rays + 1);
    for (int r = 0; r < count; ++r) {
        const int samples = *rc::gen::inRange(0, 25);
        float depth = 0;
        for (int k = 0; k < samples; ++k) {
            const float length = static_cast<float>(*rc::gen::inRange(0, 65)) / 64;
            const float o = *density, e = *density;
            drawn.rays.add_sample(length, o, *any_share(), e, *any_share(), *any_share(), *any_share());
            if (length > 0) depth += std::min(1e30f, (o + e) * length);
        }
        drawn.rays.end_ray();
        drawn.depth = std::max(drawn.depth, depth);
    }
    return drawn;
}

}  // namespace fieldgraft::stability
