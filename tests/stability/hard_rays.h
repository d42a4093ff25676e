// The rays that break textbook formulas: the grid of optical depths, lengths and shares that every formula has to
// stand, and the cases that a grid does not hold.
#pragma once

#include <limits>
#include <random>
#include <string>
#include <vector>

#include "tests/kernels/blend_cases.h"

namespace fieldgraft::stability {

struct HardRay {
    std::string input;  // the class it belongs to
    Rays<float> rays;   // one ray
};

inline const std::vector<float>& hard_depths() {
    static const std::vector<float> depths{
        0, 1e-38f, 1e-12f, 1e-7f, 1e-3f, 1, 20, 100, 1e4f, 1e30f, std::numeric_limits<float>::infinity()};
    return depths;
}
inline const std::vector<float> hard_betas{0, 1e-8f, 0.5f, 1 - 1e-7f, 1};

inline std::string depth_class(float depth) {
    if (depth == 0) return "empty space";
    if (depth <= 1e-7f) return "thin: a ≤ 1e-7";
    if (depth < 20) return "ordinary: a = 1e-3 … 1";
    return depth < 1e30f ? "opaque: a = 20 … 1e4" : "clamped: a = 1e30, ∞";
}

inline Rays<float> uniform_ray(float depth_o, float depth_e, float beta, int samples) {
    Rays<float> rays;
    for (int k = 0; k < samples; ++k) rays.add_sample(1, depth_o, 0.75f, depth_e, 0.5f, beta, beta);
    rays.end_ray();
    return rays;
}

// a × a × β × K ∈ {1, 2, 64}.
inline std::vector<HardRay> grid_rays() {
    std::vector<HardRay> all;
    for (const int samples : {1, 2, 64}) {
        for (const float o : hard_depths()) {
            for (const float e : hard_depths()) {
                for (const float beta : hard_betas)
                    all.push_back({depth_class(std::max(o, e)), uniform_ray(o, e, beta, samples)});
            }
        }
    }
    return all;
}

// Like uniform_ray, density and length of sample k from a function.
template <class F>
HardRay made_ray(std::string input, int samples, F of) {
    HardRay ray{std::move(input), {}};
    for (int k = 0; k < samples; ++k) of(ray.rays, k);
    ray.rays.end_ray();
    return ray;
}

// 4,096 samples: thin media, ordinary ones, clamped ones, and a wall at the end of a haze.
inline std::vector<HardRay> long_rays() {
    std::vector<HardRay> all;
    for (const float a : {1e-9f, 1e-6f, 1e-3f})
        all.push_back({"thin haze, 4,096 samples", uniform_ray(a, a, 0.5f, 4096)});
    all.push_back({"4,096 samples, a = 1", uniform_ray(1, 1e-7f, 1e-8f, 4096)});
    all.push_back({"4,096 samples, a = 1e30", uniform_ray(1e30f, 0, 1 - 1e-7f, 4096)});
    all.push_back(made_ray("wall behind haze, 4,096 samples", 4096, [](Rays<float>& r, int k) {
        r.add_sample(0.01f, k < 4095 ? 1e-4f : 1e6f, 0.75f, k < 4095 ? 1e-3f : 1e5f, 0.5f, 0.25f, 0.5f);
    }));
    return all;
}

inline std::vector<HardRay> special_rays() {
    std::vector<HardRay> all;
    const float inf = std::numeric_limits<float>::infinity();
    all.push_back(made_ray("ray that misses", 0, [](Rays<float>&, int) {}));
    all.push_back(
        made_ray("near = far", 1, [](Rays<float>& r, int) { r.add_sample(0, 3, 0.75f, 2, 0.5f, 0.5f, 0.5f); }));
    all.push_back(made_ray("near = far", 1, [=](Rays<float>& r, int) { r.add_sample(0, inf, 0.5f, inf, 1, 0.5f, 1); }));
    for (const float haze : {1e-6f, 1e-3f, 0.1f}) {
        all.push_back(made_ray("wall behind haze", 64, [=](Rays<float>& r, int k) {
            r.add_sample(0.1f, k < 63 ? haze : 1e5f, 0.75f, k < 60 ? haze : 0, 0.5f, 1e-4f, 0.5f);
        }));
    }
    for (const float dense : {20.0f, 1e4f, 1e30f}) {
        all.push_back(made_ray("two opaque media in one interval", 8, [=](Rays<float>& r, int k) {
            r.add_sample(1, k == 4 ? dense : 1e-3f, 0.75f, k == 4 ? dense : 0, 0.5f, 0.25f, 0.5f);
        }));
    }
    all.push_back(made_ray("zero-length and repeated samples", 64, [=](Rays<float>& r, int k) {
        const float length = k % 3 == 0 ? 0 : 0.05f;
        r.add_sample(length, k % 3 == 0 ? (k % 2 ? inf : 1e6f) : 2, 0.75f, k % 3 == 0 ? 1e9f : 0.5f, 0.5f, 0.5f, 0.5f);
    }));
    for (const float a : {1e-7f, 1e-2f, 1.0f, 100.0f}) {
        all.push_back(made_ray("edit that removed everything", 32,
                               [=](Rays<float>& r, int) { r.add_sample(1, a, 0.75f, 0, 0.5f, 1, 0); }));
        all.push_back(made_ray("edit that does nothing yet", 32,
                               [=](Rays<float>& r, int) { r.add_sample(1, a, 0.75f, 0, 0.5f, 0, 0); }));
    }
    std::mt19937 engine(11);
    std::uniform_real_distribution<float> u(0, 1);
    for (int i = 0; i < 40; ++i) {
        all.push_back(made_ray("random, a = 1e-12 … 1e3", 48, [&](Rays<float>& r, int) {
            r.add_sample(u(engine), std::pow(10.0f, 15 * u(engine) - 12), u(engine),
                         std::pow(10.0f, 15 * u(engine) - 12), u(engine), u(engine), u(engine));
        }));
    }
    return all;
}

}  // namespace fieldgraft::stability
