// Plain compositing on hard rays against 50 digits: colour, transmittance, depth, gradients. It has one path.
#include "core/kernels/composite_ref.h"

#include <gtest/gtest.h>

#include "tests/stability/big.h"
#include "tests/stability/hard_rays.h"
#include "tests/stability/ledger.h"

namespace fieldgraft::stability {
namespace {

constexpr const char* path = "reference";

// The rays' own medium, sample k at distance 1 + k/8.
struct Plain {
    const HardRay& ray;
    std::vector<float> t;

    explicit Plain(const HardRay& from) : ray(from) {
        for (std::size_t k = 0; k < ray.rays.delta.size(); ++k) t.push_back(1 + static_cast<float>(k) / 8);
    }
    std::size_t size() const { return t.size(); }
    CompositeInput<float> input() const {
        return {ray.rays.start, ray.rays.delta, t, ray.rays.density_o, ray.rays.color_o};
    }
};

struct Right {
    Big color = 0, transmittance = 0, depth = 0, all = 0;
    Big color_unit = 0, depth_unit = 0;
    std::vector<Big> density_grad, density_unit, color_grad, color_grad_unit;

    explicit Right(const Plain& p) {
        const std::size_t n = p.size();
        std::vector<Big> a, front, weight;
        Big distance = 0, weights = 0;
        for (std::size_t k = 0; k < n; ++k) {
            a.push_back(oracle::clamped_depth<Big>(p.ray.rays.density_o[k], p.ray.rays.delta[k]));
            front.push_back(all);
            weight.push_back(exp_of(-all) * minus_expm1_of(-a[k]));
            all += a[k];
            color += weight[k] * p.ray.rays.color_o[3 * k];
            color_unit += weight[k] * p.ray.rays.color_o[3 * k] * (1 + front[k]);
            distance += weight[k] * p.t[k];
            weights += weight[k];
            depth_unit += weight[k] * p.t[k] * (1 + front[k]);
        }
        transmittance = exp_of(-all);
        depth = weights > 0 ? Big(distance / weights) : Big(0);
        depth_unit = weights > 0 ? Big(depth_unit / weights) : Big(1);
        // Of color + transmittance.
        density_grad.resize(n);
        density_unit = color_grad = color_grad_unit = density_grad;
        Big behind = transmittance, behind_unit = transmittance * (1 + all);
        for (std::size_t k = n; k-- > 0;) {
            const Big shown = p.ray.rays.color_o[3 * k], direct = exp_of(-front[k] - a[k]) * shown;
            const Big length = a[k] < Big(1e30L) ? Big(p.ray.rays.delta[k]) : Big(0);
            density_grad[k] = length * (direct - behind);
            density_unit[k] = length * (direct * (1 + front[k] + a[k]) + behind_unit);
            color_grad[k] = weight[k];
            color_grad_unit[k] = weight[k] * (1 + front[k]);
            behind += weight[k] * shown;
            behind_unit += weight[k] * shown * (1 + front[k]);
        }
    }
};

// α = 1 − exp(−σδ), products of (1 − α), gradients by total minus what came before.
struct Naive {
    float color = 0, transmittance = 1, depth = 0;
    std::vector<float> density_grad, color_grad;

    explicit Naive(const Plain& p) {
        float weights = 0, distance = 0;
        std::vector<float> before, passed, alpha;
        for (std::size_t k = 0; k < p.size(); ++k) {
            alpha.push_back(1 - std::exp(-p.ray.rays.density_o[k] * p.ray.rays.delta[k]));
            const float weight = transmittance * alpha[k];
            passed.push_back(transmittance);
            color_grad.push_back(weight);
            color += weight * p.ray.rays.color_o[3 * k];
            before.push_back(color);
            weights += weight;
            distance += weight * p.t[k];
            transmittance *= 1 - alpha[k];
        }
        depth = distance / weights;
        for (std::size_t k = 0; k < p.size(); ++k) {
            const float direct = passed[k] * (1 - alpha[k]) * p.ray.rays.color_o[3 * k];
            density_grad.push_back(p.ray.rays.delta[k] * (direct - (color - before[k] + transmittance)));
        }
    }
};

void check(const HardRay& ray) {
    const Plain plain(ray);
    const Right right(plain);
    const Naive naive(plain);
    const std::size_t n = plain.size();
    std::vector<float> color(3), transmittance(1), depth(1), density_grad(n), color_grad(3 * n);
    composite_forward<float>(plain.input(), color, transmittance, depth, serial_for);
    const std::vector<float> color_one{1, 0, 0}, one{1};
    composite_backward<float>(plain.input(), color_one, one, density_grad, color_grad, serial_for);

    const double below = 2 * smallest * static_cast<double>(n + 1);
    const auto add = [&](const char* quantity, const char* part, float found, float other, const Big& value,
                         const Big& unit, double floor) {
        ledger().add(quantity, part, path, ray.input, error_of(found, value, unit, floor),
                     error_of(other, value, unit, floor));
    };
    add("plain colour", "value", color[0], naive.color, right.color, right.color_unit, below);
    add("plain transmittance", "value", transmittance[0], naive.transmittance, right.transmittance,
        right.transmittance * (1 + right.all), below);
    // Distances are means: where no weight is a normal number there is none.
    const bool seen = right.all > 1e-30;
    if (seen || right.all == 0) add("depth", "value", depth[0], naive.depth, right.depth, right.depth_unit, below);
    for (std::size_t k = 0; k<n; k += n> 64 ? 97 : 1) {
        const float length = ray.rays.delta[k];
        add("plain light by σ", "gradient", density_grad[k], naive.density_grad[k], right.density_grad[k],
            right.density_unit[k], below * (1 + length));
        add("plain light by c", "gradient", color_grad[3 * k], naive.color_grad[k], right.color_grad[k],
            right.color_grad_unit[k], below);
    }
}

TEST(PlainRays, Hard) {
    for (const float a : hard_depths()) {
        for (const int samples : {1, 2, 64}) check({depth_class(a), uniform_ray(a, 0, 0, samples)});
    }
    for (const HardRay& ray : special_rays()) check(ray);
}

TEST(PlainRays, FourThousandSamples) {
    for (const HardRay& ray : long_rays()) check(ray);
}

}  // namespace
}  // namespace fieldgraft::stability
