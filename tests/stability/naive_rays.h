// What a textbook writes down for a blended ray, in float32: α = 1 − exp(−σδ), transmittance as a product of (1 − α),
// plain differences and quotients, and gradients by "total minus what came before". Only to be compared with: each
// of these breaks somewhere.
#pragma once

#include <cmath>
#include <vector>

#include "tests/kernels/blend_cases.h"

namespace fieldgraft::stability {

struct NaiveRay {
    float color = 0, color_edit = 0, transmittance = 1, added = 0, removed = 0, changed = 0;
    std::vector<float> weight_o, weight_e;
    std::array<std::vector<float>, 4> light;  // gradients as in RayGradients
    std::array<std::vector<float>, 4> maps;

    NaiveRay(const BlendMode& mode, const Rays<float>& ray) {
        const std::size_t n = ray.delta.size();
        for (auto* heads : {&light, &maps})
            for (auto& head : *heads) head.assign(n, 0);
        std::vector<float> worth(n), before(n), added_before(n);
        float kept_before = 1, o_before = 1, removed_scale = 0, light_sum = 0;
        for (std::size_t k = 0; k < n; ++k) {
            const Sample s(mode, ray, k);
            const float wo = transmittance * s.unit_o, we = transmittance * s.unit_e;
            const float blended = (1 - s.beta_color) * s.color_o + s.beta_color * s.color_e;
            color += wo * blended + we * s.color_e;
            color_edit += (wo * s.beta_color + we) * s.color_e;
            added += we;
            changed += wo * s.beta_color;
            weight_o.push_back(wo);
            weight_e.push_back(we);
            const float seen = mode.visible ? o_before * s.alpha_o : s.alpha_o;
            removed += mode.visible ? seen * s.beta_density : (kept_before - o_before) * s.alpha_o;
            removed_scale += seen;
            maps[2][k] = seen;
            worth[k] = wo * worth_o(s) + we * worth_e(s);
            light_sum += worth[k];
            before[k] = light_sum;
            added_before[k] = added;
            light[1][k] = 2 * (wo * s.beta_color + we);
            light[3][k] = wo * (worth_e(s) - s.color_o);
            maps[3][k] = wo;
            transmittance *= (1 - s.alpha_kept) * (1 - s.alpha_e);
            kept_before *= 1 - s.alpha_kept;
            o_before *= 1 - s.alpha_o;
        }
        removed /= removed_scale;
        gradients(mode, ray, light_sum + transmittance, before, added_before, removed_scale);
    }

  private:
    struct Sample {
        float color_o, color_e, beta_color, beta_density, alpha_o, alpha_kept, alpha_e, unit_o, unit_e;
        Sample(const BlendMode& mode, const Rays<float>& ray, std::size_t k)
            : color_o(ray.color_o[3 * k]),
              color_e(mode.add || mode.change ? ray.color_e[3 * k] : 0),
              beta_color(mode.change ? ray.beta_color[k] : 0),
              beta_density(mode.remove ? ray.beta_density[k] : 0) {
            const float o = ray.density_o[k], kept = (1 - beta_density) * o, e = mode.add ? ray.density_e[k] : 0;
            const auto alpha = [&](float density) { return 1 - std::exp(-density * ray.delta[k]); };
            alpha_o = alpha(o);
            alpha_kept = alpha(kept);
            alpha_e = alpha(e);
            unit_o = mode.conserving ? alpha(kept + e) * kept / (kept + e) : alpha_kept;
            unit_e = mode.conserving ? alpha(kept + e) * e / (kept + e) : alpha_e;
        }
    };
    static float worth_e(const Sample& s) { return 2 * s.color_e + 1; }
    static float worth_o(const Sample& s) { return (1 - s.beta_color) * s.color_o + s.beta_color * worth_e(s); }

    void gradients(const BlendMode& mode, const Rays<float>& ray, float total, const std::vector<float>& before,
                   const std::vector<float>& added_before, float removed_scale) {
        float t = 1, t_o = 1;
        float uncovered = 0, uncovered_all = 0;
        std::vector<float> passed;
        for (std::size_t k = 0; k < before.size(); ++k) {
            const Sample s(mode, ray, k);
            const float both = ray.density_o[k] * (1 - s.beta_density) + ray.density_e[k];
            const float share_o = ray.density_o[k] * (1 - s.beta_density) / both, share_e = ray.density_e[k] / both;
            const float through = (1 - s.alpha_kept) * (1 - s.alpha_e), alpha = 1 - through;
            const float o = worth_o(s), e = worth_e(s), behind = total - before[k];
            const auto conserving = [&](float x, float y, float share, float other) {
                return through * (share * x + other * y) + alpha * other * (x - y) / (both * ray.delta[k]);
            };
            const float of_e = mode.conserving ? conserving(e, o, share_e, share_o) : (1 - s.alpha_e) * e;
            const float of_kept = mode.conserving ? conserving(o, e, share_o, share_e) : (1 - s.alpha_kept) * o;
            const float map_e = mode.conserving ? conserving(1, 0, share_e, share_o) : 1 - s.alpha_e;
            light[0][k] = ray.delta[k] * (t * of_e - behind);
            light[2][k] = -ray.density_o[k] * ray.delta[k] * (t * of_kept - behind);
            maps[0][k] = ray.delta[k] * (t * map_e - (added - added_before[k]));
            if (mode.visible) maps[2][k] /= removed_scale;
            t *= through;
            passed.push_back(t_o * s.alpha_o);
            uncovered_all += passed[k];
            t_o *= 1 - s.alpha_kept;
        }
        for (std::size_t k = 0; k < before.size() && !mode.visible; ++k) {
            uncovered += passed[k];
            maps[2][k] = ray.density_o[k] * ray.delta[k] * (uncovered_all - uncovered) / removed_scale;
        }
    }
};

}  // namespace fieldgraft::stability
