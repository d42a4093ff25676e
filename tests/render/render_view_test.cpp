#include "core/render/render_view.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/render/blend.h"
#include "core/render/image_metrics.h"
#include "tests/render/synthetic_field.h"

namespace fieldgraft {
namespace {

using testing::inward_rays;
using testing::uneven_field;

TEST(Composite, GradientsReachDensityAndColourInBothPrecisions) {
    const Tensor start = torch::tensor({0, 2, 2, 5}, at::kLong);
    for (const auto type : {at::kFloat, at::kDouble}) {
        const Tensor delta = testing::random_tensor({5}, 1, 0.1f, 0.5f).to(type);
        Tensor density = testing::random_tensor({5}, 2, 0.1f, 3).to(type).requires_grad_(true);
        Tensor color = testing::random_tensor({5, 3}, 3, 0, 1).to(type).requires_grad_(true);
        const CompositeOut out = composite(start, delta, delta, density, color);
        (out.color.sum() + out.transmittance.sum()).backward();
        // The same in tensor operations, two rays apart.
        Tensor d2 = density.detach().clone().requires_grad_(true), c2 = color.detach().clone().requires_grad_(true);
        Tensor total = at::zeros({}, type);
        for (const auto& [first, count] : {std::pair{0, 2}, std::pair{2, 3}}) {
            const Tensor a = d2.narrow(0, first, count) * delta.narrow(0, first, count);
            const Tensor before = at::exp(-(a.cumsum(0) - a));
            total = total + ((before * (1 - at::exp(-a))).unsqueeze(1) * c2.narrow(0, first, count)).sum() +
                    at::exp(-a.sum());
        }
        total.backward();
        EXPECT_TRUE(at::allclose(density.grad(), d2.grad(), 1e-4, 1e-6));
        EXPECT_TRUE(at::allclose(color.grad(), c2.grad(), 1e-4, 1e-6));
        EXPECT_FALSE(out.depth.requires_grad());
    }
    EXPECT_THROW(composite(start, at::ones({4}), at::ones({5}), at::ones({5}), at::ones({5, 3})),
                 std::invalid_argument);
    EXPECT_THROW(composite(start, at::ones({5}), at::ones({5}), at::ones({5}, at::kDouble), at::ones({5, 3})),
                 std::invalid_argument);
}

TEST(RenderView, EqualsCompositingTheWholeMarch) {
    const RadianceField field = uneven_field();
    const RayBundle rays = inward_rays(150, 9);
    RenderOptions options;
    options.march.step = 0.02;
    const RenderedRays out = render_rays(field, rays, options);
    const Samples all = march(field.geometry(), {}, rays, options.march);
    const auto medium = field.density(all.positions);
    const Tensor color = field.color(medium.features, rays.directions.index_select(0, all.ray));
    const CompositeOut exact = composite(all.start, all.delta, all.t, medium.density, color);
    EXPECT_LT((out.color - exact.color).abs().max().item<float>(), 1.1e-4f);
    EXPECT_LT((out.alpha - (1 - exact.transmittance)).abs().max().item<float>(), 1.1e-4f);
    EXPECT_GT(out.alpha.max().item<float>(), 0.9f);
}

TEST(RenderView, ChunksDoNotMatterAndShapesAreImages) {
    const RadianceField field = uneven_field();
    const RayBundle rays = inward_rays(60, 11);
    RenderOptions options;
    options.march.step = 0.05;
    const RenderedView whole = render_view(field, rays, 6, 10, options);
    options.chunk_rays = 7;
    const RenderedView parts = render_view(field, rays, 6, 10, options);
    EXPECT_TRUE(at::allclose(whole.color, parts.color, 1e-5, 1e-6));
    EXPECT_EQ(whole.color.sizes(), (std::vector<std::int64_t>{6, 10, 3}));
    EXPECT_EQ(whole.alpha.sizes(), (std::vector<std::int64_t>{6, 10}));
    EXPECT_THROW(render_view(field, rays, 6, 9, options), std::invalid_argument);
    options.chunk_rays = 0;
    EXPECT_THROW(render_rays(field, rays, options), std::invalid_argument);
}

TEST(RenderView, CountsTheSamplesItAsksColoursOf) {
    const RadianceField field = uneven_field();
    const RayBundle rays = inward_rays(700, 11);  // more than a range
    RenderOptions options;
    options.march.step = 0.05;
    const SampleCounts counts = count_samples(field, rays, options);
    EXPECT_EQ(counts.visible, sample_visible(field, rays, options.march).samples.size());
    EXPECT_GE(counts.looked_at, counts.visible);
    EXPECT_LE(counts.looked_at, march(field.geometry(), {}, rays, options.march).size());
    options.march.step = 0.025;
    EXPECT_GT(count_samples(field, rays, options).visible, counts.visible);
}

TEST(RenderView, BackgroundFillsWhatIsTransparent) {
    const Tensor color = at::zeros({1, 2, 3}), alpha = torch::tensor({{0.f, 0.75f}});
    const Tensor shown = over_background_color(color, alpha, {1, 0.5f, 0});
    EXPECT_FLOAT_EQ(shown[0][0][1].item<float>(), 0.5f);
    EXPECT_FLOAT_EQ(shown[0][1][0].item<float>(), 0.25f);
}

TEST(ImageMetrics, PsnrOfAKnownError) {
    const Tensor a = at::zeros({4, 5, 3}), b = at::full({4, 5, 3}, 0.1);
    EXPECT_NEAR(psnr(a, b), 20, 1e-6);
    EXPECT_TRUE(std::isinf(psnr(a, a)));
    EXPECT_THROW(psnr(a, at::zeros({4, 4, 3})), std::invalid_argument);
}

// SSIM from its definition, pixel by pixel.
double direct_ssim(const Tensor& a, const Tensor& b) {
    std::vector<double> g(11);
    double norm = 0, total = 0;
    for (int i = 0; i < 11; ++i) norm += g[i] = std::exp(-(i - 5.0) * (i - 5.0) / (2 * 1.5 * 1.5));
    const auto x = a.accessor<float, 3>(), y = b.accessor<float, 3>();
    int count = 0;
    for (int c = 0; c < a.size(2); ++c) {
        for (int row = 5; row + 5 < a.size(0); ++row) {
            for (int col = 5; col + 5 < a.size(1); ++col, ++count) {
                double mx = 0, my = 0, xx = 0, yy = 0, xy = 0;
                for (int i = -5; i <= 5; ++i) {
                    for (int j = -5; j <= 5; ++j) {
                        const double w = g[i + 5] * g[j + 5] / (norm * norm);
                        const double p = x[row + i][col + j][c], q = y[row + i][col + j][c];
                        mx += w * p, my += w * q, xx += w * p * p, yy += w * q * q, xy += w * p * q;
                    }
                }
                total += (2 * mx * my + 1e-4) * (2 * (xy - mx * my) + 9e-4) /
                         ((mx * mx + my * my + 1e-4) * (xx - mx * mx + yy - my * my + 9e-4));
            }
        }
    }
    return total / count;
}

TEST(ImageMetrics, SsimIsTheDefinition) {
    const Tensor a = testing::random_tensor({19, 14, 3}, 1, 0, 1);
    const Tensor b = (a + testing::random_tensor({19, 14, 3}, 2, -0.2f, 0.2f)).clamp(0, 1);
    EXPECT_NEAR(ssim(a, a), 1, 1e-12);
    EXPECT_NEAR(ssim(a, b), direct_ssim(a, b), 1e-9);
    EXPECT_LT(ssim(a, b), 0.99);
    EXPECT_NEAR(ssim(at::zeros({11, 11, 1}), at::ones({11, 11, 1})), 1e-4 / (1 + 1e-4), 1e-9);
    EXPECT_THROW(ssim(at::zeros({10, 20, 3}), at::zeros({10, 20, 3})), std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
