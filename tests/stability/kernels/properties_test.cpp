// What must hold for all rays, looked for with random ones (RapidCheck prints what it takes to see a failure again).
#include <gtest/gtest.h>

#include <numeric>

#include "core/kernels/composite_ref.h"
#include "core/kernels/exp_simd.h"
#include "tests/stability/random_rays.h"

namespace fieldgraft::stability {
namespace {

constexpr float ulp = 0x1p-23f;

std::vector<BlendMath<float>> both_paths() {
    return {library_math<float>(), {exp_negative, one_minus_exp_negative}};
}

struct PlainOut {
    std::vector<float> color, transmittance, depth;
};

PlainOut plain(const Rays<float>& rays) {
    const std::size_t count = static_cast<std::size_t>(rays.rays());
    PlainOut out{std::vector<float>(3 * count), std::vector<float>(count), std::vector<float>(count)};
    std::vector<float> t(rays.delta.size());
    std::iota(t.begin(), t.end(), 1.0f);
    composite_forward<float>({rays.start, rays.delta, t, rays.density_o, rays.color_o}, out.color, out.transmittance,
                             out.depth, serial_for);
    return out;
}

std::int64_t samples_of(const Rays<float>& rays, std::int64_t r) {
    return rays.start[r + 1] - rays.start[r];
}

// With every colour 1, the ray's colour is the sum of its weights.
void make_white(Rays<float>& rays) {
    std::fill(rays.color_o.begin(), rays.color_o.end(), 1.0f);
    std::fill(rays.color_e.begin(), rays.color_e.end(), 1.0f);
}

BlendMode any_mode(bool conserving) {
    const int ops = *rc::gen::inRange(1, 8);
    return {(ops & 1) != 0, (ops & 2) != 0, (ops & 4) != 0, conserving, *rc::gen::inRange(0, 2) == 1};
}

TEST(Property, WeightsAndWhatPassesThroughSumToOne) {
    EXPECT_TRUE(rc::check([] {
        Rays<float> rays = draw_rays(any_density()).rays;
        make_white(rays);
        const PlainOut alone = plain(rays);
        const auto near_one = [&](float sum, std::int64_t r) {
            return std::abs(sum - 1) <= 2 * ulp * static_cast<float>(1 + samples_of(rays, r));
        };
        for (std::int64_t r = 0; r < rays.rays(); ++r)
            RC_ASSERT(near_one(alone.color[3 * r] + alone.transmittance[r], r));
        const BlendMode mode = any_mode(true);
        for (const auto& math : both_paths()) {
            const auto out = forward(mode, rays, math);
            for (std::int64_t r = 0; r < rays.rays(); ++r)
                RC_ASSERT(near_one(out.color[3 * r] + out.transmittance[r], r));
        }
    }));
}

TEST(Property, TransmittanceNeverRises) {
    EXPECT_TRUE(rc::check([] {
        const Rays<float> rays = draw_rays(any_density(), 1).rays;
        const BlendMode mode = any_mode(false);
        for (const auto& math : both_paths()) {
            float before = 1;
            for (std::int64_t samples = 0; samples <= samples_of(rays, 0); ++samples) {
                Rays<float> part = rays;
                part.start = {0, samples};
                const float now = forward(mode, part, math).transmittance[0];
                RC_ASSERT(now >= 0);
                RC_ASSERT(now <= before * (1 + 2 * ulp));
                before = now;
            }
        }
    }));
}

// Every interval cut into `parts` equal ones.
template <class Real>
Rays<Real> cut(const Rays<Real>& rays, int parts) {
    Rays<Real> out;
    for (std::int64_t r = 0; r < rays.rays(); ++r) {
        for (std::int64_t k = rays.start[r]; k < rays.start[r + 1]; ++k) {
            for (int p = 0; p < parts; ++p)
                out.add_sample(rays.delta[k] / static_cast<Real>(parts), rays.density_o[k], rays.color_o[3 * k],
                               rays.density_e[k], rays.color_e[3 * k], rays.beta_density[k], rays.beta_color[k]);
        }
        out.end_ray();
    }
    return out;
}

TEST(Property, CuttingIntervalsChangesNothing) {
    EXPECT_TRUE(rc::check([] {
        const Rays<float> rays = draw_rays(finite_density()).rays, halves = cut(rays, 2);
        BlendMode mode = any_mode(true);
        mode.visible = true;  // what is removed, as the paper has it, does depend on the intervals
        for (const auto& math : both_paths()) {
            auto whole = forward(mode, rays, math), parts = forward(mode, halves, math);
            // Rounding of a depth A is a relative error of A ε in e⁻ᴬ, at most ε/e in all.
            for (std::int64_t r = 0; r < rays.rays(); ++r) {
                const float allowed = 4 * ulp * static_cast<float>(2 + samples_of(rays, r));
                for (std::size_t i = 0; i < whole.all().size(); ++i) {
                    if (whole.all()[i] == &whole.removed) continue;  // a quotient of these
                    const std::size_t at = whole.all()[i]->size() > whole.added.size() ? 3 * r : r;
                    RC_ASSERT(std::abs((*whole.all()[i])[at] - (*parts.all()[i])[at]) <= allowed);
                }
            }
        }
    }));
}

TEST(Property, OrderOfRaysDoesNotMatter) {
    EXPECT_TRUE(rc::check([] {
        const Rays<float> rays = draw_rays(any_density()).rays;
        Rays<float> reversed;
        for (std::int64_t r = rays.rays(); r-- > 0;) {
            for (std::int64_t k = rays.start[r]; k < rays.start[r + 1]; ++k)
                reversed.add_sample(rays.delta[k], rays.density_o[k], rays.color_o[3 * k], rays.density_e[k],
                                    rays.color_e[3 * k], rays.beta_density[k], rays.beta_color[k]);
            reversed.end_ray();
        }
        const BlendMode mode = any_mode(*rc::gen::inRange(0, 2) == 1);
        for (const auto& math : both_paths()) {
            auto one = forward(mode, rays, math), other = forward(mode, reversed, math);
            for (std::size_t i = 0; i < one.all().size(); ++i) {
                const std::size_t width = one.all()[i]->size() / static_cast<std::size_t>(rays.rays());
                for (std::int64_t r = 0; r < rays.rays(); ++r) {
                    for (std::size_t c = 0; c < width; ++c)
                        RC_ASSERT((*one.all()[i])[r * width + c] ==
                                  (*other.all()[i])[(rays.rays() - 1 - r) * width + c]);
                }
            }
        }
    }));
}

// An edit whose heads are 0 leaves a ray's colour and transmittance what they are without any, to rounding; where no
// edit acts at all, pictures come from the plain path (Property.StrengthZero… of the engine), bit for bit.
TEST(Property, HeadsOfZeroChangeNothing) {
    EXPECT_TRUE(rc::check([] {
        Rays<float> rays = draw_rays(any_density()).rays;
        for (auto* head : {&rays.density_e, &rays.beta_density, &rays.beta_color})
            std::fill(head->begin(), head->end(), 0.0f);
        const PlainOut alone = plain(rays);
        const BlendMode mode = any_mode(*rc::gen::inRange(0, 2) == 1);
        const auto out = forward(mode, rays);
        for (std::int64_t r = 0; r < rays.rays(); ++r) {
            RC_ASSERT(out.transmittance[r] == alone.transmittance[r]);
            RC_ASSERT(out.added[r] + out.removed[r] + out.changed[r] == 0);
            RC_ASSERT(std::abs(out.color[3 * r] - alone.color[3 * r]) <=
                      2 * ulp * static_cast<float>(1 + samples_of(rays, r)));
        }
    }));
}

// The two rules agree as intervals shrink: their gap falls with the interval's length.
TEST(Property, RulesAgreeAsStepsShrink) {
    EXPECT_TRUE(rc::check([] {
        const Rays<float> drawn = draw_rays(moderate_density(), 1).rays;
        Rays<double> rays;
        for (std::size_t k = 0; k < drawn.delta.size(); ++k)
            rays.add_sample(drawn.delta[k], drawn.density_o[k], drawn.color_o[3 * k], drawn.density_e[k],
                            drawn.color_e[3 * k], drawn.beta_density[k], drawn.beta_color[k]);
        rays.end_ray();
        BlendMode mode = any_mode(false);
        mode.add = true;
        const auto gap = [&](int parts) {
            const Rays<double> fine = cut(rays, parts);
            BlendMode other = mode;
            other.conserving = true;
            const auto a = forward(mode, fine), b = forward(other, fine);
            double sum = 0;
            for (int c = 0; c < 3; ++c)
                sum += std::abs(a.color[c] - b.color[c]) + std::abs(a.color_edit[c] - b.color_edit[c]);
            return sum + std::abs(a.added[0] - b.added[0]);
        };
        const double coarse = gap(32), fine = gap(128);
        RC_ASSERT(fine <= 0.4 * coarse + 1e-9);
        RC_ASSERT(fine <= 0.05);
    }));
}

}  // namespace
}  // namespace fieldgraft::stability
