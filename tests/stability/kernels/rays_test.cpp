// The blended kernels on hard rays: every output and every gradient, reference and SIMD, against 50 digits.
#include <gtest/gtest.h>

#include "core/kernels/exp_simd.h"
#include "tests/kernels/numeric.h"
#include "tests/kernels/simd_targets.h"
#include "tests/stability/hard_rays.h"
#include "tests/stability/ledger.h"
#include "tests/stability/naive_rays.h"
#include "tests/stability/ray_gradients.h"

namespace fieldgraft::stability {
namespace {

const BlendMode paper{true, true, true, false, false}, conserving{true, true, true, true, true};

// One ray, what is right and what a textbook's formula says.
class RayCheck {
  public:
    RayCheck(const BlendMode& mode, const HardRay& ray)
        : mode_(mode),
          ray_(ray),
          n_(ray.rays.delta.size()),
          big_(oracle_ray<Big>(ray.rays, 0, 0)),
          right_(oracle::blend(mode, big_)),
          light_(light_gradients(mode, big_)),
          maps_(map_gradients(mode, big_)),
          naive_(mode, ray.rays) {}

    void check(const std::string& path, const BlendMath<float>& math) {
        path_ = path;
        values(math);
        weights(math);
        gradients(math);
    }

  private:
    // Each of n samples may lose what lies below the smallest float.
    double floor(double scale = 1) const { return smallest * static_cast<double>(n_ + 1) * (1 + scale); }

    void add(const std::string& quantity, const std::string& part, double found, double naive, const Big& right,
             const Big& unit, double below) {
        ledger().add(quantity, part, path_, ray_.input, error_of(found, right, unit, below),
                     error_of(naive, right, unit, below));
    }

    void values(const BlendMath<float>& math) {
        const RayValues<float> out = forward(mode_, ray_.rays, math);
        const Big depth =
            right_.front.empty()
                ? Big(0)
                : Big(right_.front.back() + RaySample(mode_, big_, n_ - 1).kept + RaySample(mode_, big_, n_ - 1).edit);
        const auto value = [&](const std::string& name, float found, float naive, const Big& right, const Big& unit) {
            add(name, "value", found, naive, right, unit, floor());
        };
        value("transmittance T", out.transmittance[0], naive_.transmittance, right_.transmittance,
              right_.transmittance * (1 + depth));
        value("colour Cᵝ", out.color[0], naive_.color, right_.color, right_.weight_bound);
        value("colour of the edit Cᵉ", out.color_edit[0], naive_.color_edit, right_.color_edit, right_.weight_bound);
        value("E_add", out.added[0], naive_.added, right_.added, right_.weight_bound);
        value("E_change", out.changed[0], naive_.changed, right_.changed, right_.weight_bound);
        value(removed_name(), out.removed[0], naive_.removed, right_.removed, right_.removed_bound + right_.removed);
    }
    std::string removed_name() const { return mode_.visible ? "E_remove, visible" : "E_remove, paper"; }

    std::vector<std::size_t> some_samples() const {
        if (n_ == 0) return {};
        return {std::size_t{0}, n_ / 2, n_ - 1};
    }

    // The weight of one sample: the ray's colour when only that sample has any.
    void weights(const BlendMath<float>& math) {
        BlendMode mode = mode_;
        mode.change = false;
        const std::string name = mode_.conserving ? "weights, conserving" : "weights, paper";
        for (const std::size_t k : some_samples()) {
            Rays<float> one = ray_.rays;
            std::fill(one.color_o.begin(), one.color_o.end(), 0.0f);
            std::fill(one.color_e.begin(), one.color_e.end(), 0.0f);
            const auto check = [&](std::vector<float>& color, float naive, const Big& right) {
                color[3 * k] = 1;
                add(name, "value", forward(mode, one, math).color[0], naive, right, right * (1 + right_.front[k]),
                    floor());
                color[3 * k] = 0;
            };
            check(one.color_o, naive_.weight_o[k], right_.weight_o[k]);
            check(one.color_e, naive_.weight_e[k], right_.weight_e[k]);
        }
    }

    void gradients(const BlendMath<float>& math) {
        RayValues<float> light(1), maps(1);
        light.color[0] = light.color_edit[0] = light.alpha_edit[0] = light.transmittance[0] = 1;
        maps.added[0] = maps.removed[0] = maps.changed[0] = 1;
        const auto of_light = backward(mode_, ray_.rays, light, math), of_maps = backward(mode_, ray_.rays, maps, math);
        const std::array<std::string, 4> names{"light by σᵉ", "light by cᵉ", "light by βσ", "light by βc"};
        const std::array<std::string, 4> map_names{"E_add", "", removed_name(), "E_change"};
        for (std::size_t k = 0; k<n_; k += n_> 64 ? 97 : 1) {
            for (std::size_t head = 0; head < 4; ++head) {
                const std::size_t at = head == 1 ? 3 * k : k;
                const double scale = head == 2 ? std::min(ray_.rays.density_o[k] * ray_.rays.delta[k], 1e30f) : 1;
                const double below = floor(std::isnan(scale) ? 0 : scale);
                add(names[head], "gradient", of_light[head][at], naive_.light[head][k], light_.value[head][k],
                    light_.unit[head][k], below);
                if (head == 1) continue;
                add(map_names[head], "gradient", of_maps[head][at], naive_.maps[head][k], maps_.value[head][k],
                    maps_.unit[head][k], below);
            }
        }
    }

    BlendMode mode_;
    const HardRay& ray_;
    std::size_t n_;
    oracle::Ray<Big> big_;
    oracle::Values<Big> right_;
    RayGradients light_, maps_;
    NaiveRay naive_;
    std::string path_;
};

void check_all(const std::vector<HardRay>& rays) {
    const BlendMath<float> simd{exp_negative, one_minus_exp_negative};
    for (const HardRay& ray : rays) {
        for (const BlendMode& mode : {paper, conserving}) {
            RayCheck check(mode, ray);
            check.check("reference", library_math<float>());
            testing::on_every_target([&] { check.check("SIMD", simd); });
        }
        if (::testing::Test::HasFailure()) return;
    }
}

TEST(HardRays, Grid) {
    check_all(grid_rays());
}
TEST(HardRays, Special) {
    check_all(special_rays());
}
TEST(HardRays, FourThousandSamples) {
    check_all(long_rays());
}

// The closed forms that the gradients are compared with, against differences of the oracle itself.
TEST(Oracle, GradientsAreDifferences) {
    const Big h("1e-18");
    for (BlendMode mode : all_modes()) {
        SCOPED_TRACE(name_of(mode));
        Rays<float> rays;
        const auto u = testing::random_values<float>(7 * 5, 3, 0.05, 0.95);
        for (int k = 0; k < 5; ++k)
            rays.add_sample(u[k], 3 * u[k + 5], u[k + 10], k == 2 ? 1e-12f : u[k + 15], u[k + 20], u[k + 25],
                            u[k + 30]);
        rays.end_ray();
        auto ray = oracle_ray<Big>(rays, 0, 0);
        const RayGradients light = light_gradients(mode, ray), maps = map_gradients(mode, ray);
        const std::array<std::vector<Big>*, 4> heads{&ray.density_e, &ray.color_e, &ray.beta_density, &ray.beta_color};
        for (int head = 0; head < 4; ++head) {
            for (std::size_t k = 0; has_head(mode, head) && k < ray.size(); ++k) {
                Big& x = (*heads[head])[k];
                const Big kept = x;
                x = kept + h;
                const auto up = oracle::blend(mode, ray);
                x = kept - h;
                const auto down = oracle::blend(mode, ray);
                x = kept;
                const auto difference = [&](const Big& a, const Big& b) { return Big((a - b) / (2 * h)); };
                const auto near = [&](const Big& found, const Big& right) {
                    return boost::multiprecision::abs(found - right) < Big("1e-24");
                };
                const bool colors = mode.add || mode.change;
                const Big all_up = up.color + up.transmittance + (colors ? Big(up.color_edit + up.alpha_edit) : Big(0));
                const Big all_down =
                    down.color + down.transmittance + (colors ? Big(down.color_edit + down.alpha_edit) : Big(0));
                EXPECT_TRUE(near(light.value[head][k], difference(all_up, all_down))) << "head " << head << " of " << k;
                if (head == 1) continue;
                const Big of_map = head == 0   ? difference(up.added, down.added)
                                   : head == 2 ? difference(up.removed, down.removed)
                                               : difference(up.changed, down.changed);
                EXPECT_TRUE(near(maps.value[head][k], of_map)) << "map of head " << head << " of " << k;
            }
        }
    }
}

}  // namespace
}  // namespace fieldgraft::stability
