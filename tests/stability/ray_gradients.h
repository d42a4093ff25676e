// Gradients of one blended ray in closed form, in numbers of 50 digits, with the size of what each is summed of.
// Checked against differences of oracle::blend in the same numbers (Oracle.GradientsAreDifferences).
#pragma once

#include <array>
#include <vector>

#include "tests/stability/big.h"

namespace fieldgraft::stability {

// Gradients of `color` + `color_edit` + `alpha_edit` + `transmittance`, or of one localised map, to one channel's
// inputs.
struct RayGradients {
    // density_e, color_e, beta_density, beta_color: values, and the units of their errors (ledger.h).
    std::array<std::vector<Big>, 4> value, unit;

    explicit RayGradients(std::size_t samples) {
        for (auto* part : {&value, &unit})
            for (auto& head : *part) head.assign(samples, Big(0));
    }
};

// One sample's depths, unit weights u (w = T u) and their slopes.
struct RaySample {
    Big depth_o, kept, edit, alpha_o, unit_o, unit_e;
    Big kept_o, kept_e, edit_o, edit_e;  // ∂u_o/∂aᵒ', ∂u_e/∂aᵒ', ∂u_o/∂aᵉ, ∂u_e/∂aᵉ
    bool clamped_e = false;

    RaySample(const BlendMode& mode, const oracle::Ray<Big>& ray, std::size_t k) {
        using oracle::clamped_depth;
        depth_o = clamped_depth(ray.density_o[k], ray.delta[k]);
        kept = mode.remove ? Big((1 - ray.beta_density[k]) * depth_o) : depth_o;
        edit = mode.add ? clamped_depth(ray.density_e[k], ray.delta[k]) : Big(0);
        clamped_e = edit >= Big(1e30L);
        alpha_o = minus_expm1_of(-depth_o);
        if (!mode.conserving) {
            unit_o = minus_expm1_of(-kept);
            unit_e = minus_expm1_of(-edit);
            kept_o = exp_of(-kept);
            edit_e = exp_of(-edit);
            return;
        }
        const Big both = kept + edit, part = oracle::share(both, minus_expm1_of(-both));
        // φ' = (e⁻ˣ − φ)/x, by its series where that cancels.
        const Big slope = both < Big(1e-9) ? Big(-Big(1) / 2 + both / 3 - both * both / 8 + both * both * both / 30 -
                                                 both * both * both * both / 144)
                                           : Big((exp_of(-both) - part) / both);
        unit_o = kept * part;
        unit_e = edit * part;
        kept_o = part + kept * slope;
        kept_e = edit * slope;
        edit_o = kept * slope;
        edit_e = part + edit * slope;
    }
};

// What a ray's samples are worth, and the depth in front of each.
struct RayTerms {
    std::vector<RaySample> sample;
    std::vector<Big> front, worth_o, worth_e;  // worth of a unit of wᵒ, of wᵉ
    Big front_all = 0;

    RayTerms(const BlendMode& mode, const oracle::Ray<Big>& ray) {
        for (std::size_t k = 0; k < ray.size(); ++k) {
            sample.emplace_back(mode, ray, k);
            front.push_back(front_all);
            front_all += sample[k].kept + sample[k].edit;
            const Big color_e = mode.add || mode.change ? ray.color_e[k] : Big(0);
            const Big of_edit =
                mode.add || mode.change ? Big(2 * color_e + 1) : Big(0);  // color, color_edit, alpha_edit
            const Big beta = mode.change ? ray.beta_color[k] : Big(0);
            worth_o.push_back((1 - beta) * ray.color_o[k] + beta * of_edit);
            worth_e.push_back(of_edit);
        }
    }
};

// Of color + color_edit + alpha_edit + transmittance.
inline RayGradients light_gradients(const BlendMode& mode, const oracle::Ray<Big>& ray) {
    const RayTerms terms(mode, ray);
    RayGradients out(ray.size());
    Big behind = exp_of(-terms.front_all), behind_unit = behind * (1 + terms.front_all);
    for (std::size_t k = ray.size(); k-- > 0;) {
        const RaySample& s = terms.sample[k];
        const Big t = exp_of(-terms.front[k]), reach = 1 + terms.front[k] + s.kept + s.edit;
        const Big worth_o = terms.worth_o[k], worth_e = terms.worth_e[k];
        const Big of_e = s.edit_o * worth_o + s.edit_e * worth_e, of_kept = s.kept_o * worth_o + s.kept_e * worth_e;
        const auto size = [](const Big& x) { return Big(boost::multiprecision::abs(x)); };
        const Big size_e = size(s.edit_o) * worth_o + size(s.edit_e) * worth_e;
        const Big size_kept = size(s.kept_o) * worth_o + size(s.kept_e) * worth_e;
        if (mode.add && !s.clamped_e) {
            out.value[0][k] = ray.delta[k] * (t * of_e - behind);
            out.unit[0][k] = ray.delta[k] * (t * size_e * reach + behind_unit);
        }
        const Big weight_o = t * s.unit_o, weight_e = t * s.unit_e;
        if (mode.add || mode.change) {
            const Big beta = mode.change ? ray.beta_color[k] : Big(0);
            out.value[1][k] = 2 * (weight_o * beta + weight_e);
            out.unit[1][k] = out.value[1][k] * reach;
        }
        if (mode.remove) {
            out.value[2][k] = -s.depth_o * (t * of_kept - behind);
            out.unit[2][k] = s.depth_o * (t * size_kept * reach + behind_unit);
        }
        if (mode.change) {
            out.value[3][k] = weight_o * (worth_e - ray.color_o[k]);
            out.unit[3][k] = weight_o * (worth_e + ray.color_o[k]) * reach;
        }
        behind += weight_o * worth_o + weight_e * worth_e;
        behind_unit += (weight_o * worth_o + weight_e * worth_e) * (1 + terms.front[k]);
    }
    return out;
}

// Of added by density_e, removed by beta_density, changed by beta_color: each map reaches its own head alone.
inline RayGradients map_gradients(const BlendMode& mode, const oracle::Ray<Big>& ray) {
    const RayTerms terms(mode, ray);
    const std::size_t n = ray.size();
    RayGradients out(n);
    std::vector<Big> passed_o(n), passed_kept(n), front_o(n), front_kept(n);
    Big depth_o = 0, depth_kept = 0, scale = 0;
    for (std::size_t k = 0; k < n; ++k) {
        front_o[k] = depth_o;
        front_kept[k] = depth_kept;
        passed_o[k] = exp_of(-depth_o);
        passed_kept[k] = exp_of(-depth_kept);
        scale += mode.visible ? Big(passed_o[k] * terms.sample[k].alpha_o) : terms.sample[k].alpha_o;
        depth_o += terms.sample[k].depth_o;
        depth_kept += terms.sample[k].kept;
    }
    Big added = 0, added_unit = 0, uncovered = 0, uncovered_unit = 0;  // of the samples behind
    for (std::size_t k = n; k-- > 0;) {
        const RaySample& s = terms.sample[k];
        const Big t = exp_of(-terms.front[k]), reach = 1 + terms.front[k] + s.kept + s.edit;
        if (mode.add && !s.clamped_e) {
            out.value[0][k] = ray.delta[k] * (t * s.edit_e - added);
            out.unit[0][k] = ray.delta[k] * (t * boost::multiprecision::abs(s.edit_e) * reach + added_unit);
        }
        added += t * s.unit_e;
        added_unit += t * s.unit_e * (1 + terms.front[k]);
        if (mode.remove && scale > 0) {
            const Big seen = passed_o[k] * s.alpha_o;
            out.value[2][k] = (mode.visible ? seen : Big(s.depth_o * uncovered)) / scale;
            out.unit[2][k] = (mode.visible ? Big(seen * (1 + front_o[k])) : Big(s.depth_o * uncovered_unit)) / scale;
            // Σ Tᵒ αᵒ has the rounding of its own depths.
            out.unit[2][k] += mode.visible ? out.value[2][k] : Big(0);
            uncovered += passed_kept[k] * s.alpha_o;
            uncovered_unit += passed_kept[k] * s.alpha_o * (1 + front_kept[k]);
        }
        if (mode.change) {
            out.value[3][k] = t * s.unit_o;
            out.unit[3][k] = out.value[3][k] * reach;
        }
    }
    return out;
}

}  // namespace fieldgraft::stability
