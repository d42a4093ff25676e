#include "core/render/ray_pass.h"

#include <gtest/gtest.h>

#include "core/base/spans.h"
#include "core/field/hash_network.h"
#include "core/field/radiance_field.h"
#include "core/render/blend.h"
#include "core/render/march.h"
#include "core/render/render_view.h"
#include "tests/render/synthetic_field.h"

namespace fieldgraft {
namespace {

using testing::random_tensor;

// A field with something to see: dense enough that rays end inside it, thin enough that some reach the background.
RadianceField lively_field(const HashFieldConfig& config) {
    FieldGeometry geometry;
    geometry.box_min = {-1, -0.5, -1.25};
    geometry.box_max = {1, 0.75, 1};
    RadianceField field(config, geometry, 3);
    at::NoGradGuard no_grad;
    Tensor table = field.parameters().at("encoding.table");
    table.copy_(random_tensor(table.sizes(), 4, -2, 2));
    const int r = 16;
    Tensor occupancy = (random_tensor({r, r, r}, 5, 0, 1) < 0.6).to(at::kByte);
    field.set_occupancy(occupancy);
    return field;
}

struct Batch {
    Tensor origins, directions, jitter, pixels;

    explicit Batch(std::int64_t rays) {
        origins = random_tensor({rays, 3}, 6, -2.5f, 2.5f);
        const Tensor aim = random_tensor({rays, 3}, 7, -0.9f, 0.9f) - origins;
        directions = (aim / aim.norm(2, 1, true)).contiguous();
        Random random(9);
        jitter = at::empty({rays}, at::kFloat);
        for (float& value : mutable_values(jitter)) value = random.uniform() - 0.5f;
        pixels = random_tensor({rays, 4}, 10, 0, 1);
        pixels.slice(0, 0, rays / 4).select(1, 3).zero_();  // some show the background alone
    }
};

constexpr double step = 0.02, min_transmittance = 1e-4;

std::vector<RangeFit> run(const RadianceField& field, const Batch& batch, std::int64_t rays_a_range,
                          const PlainBackground& background = {}) {
    const KernelField kernel(field);
    const MarchGrid cells = march_grid_of(field.geometry(), field.occupancy());
    const MarchRays rays{values(batch.origins), values(batch.directions), values(batch.jitter), step, 0};
    const std::int64_t count = batch.origins.size(0);
    std::vector<RangeFit> fits;
    for (std::int64_t first = 0; first < count; first += rays_a_range) {
        fits.emplace_back(field.mlp_shape());
        const RayRange range{rays, first, std::min(first + rays_a_range, count), min_transmittance};
        fit_range(kernel, cells, range, values(batch.pixels), background, fits.back());
    }
    return fits;
}

struct Gradients {
    double error = 0;
    std::int64_t samples = 0;
    std::map<std::string, Tensor> of;
};

Gradients summed(const RadianceField& field, const std::vector<RangeFit>& fits, std::int64_t rays) {
    Gradients out;
    FieldMlpGradients total(field.mlp_shape());
    std::vector<HashGridRows> rows;
    const HashGrid& grid = field.network().grid;
    for (const RangeFit& fit : fits) {
        EXPECT_TRUE(fit.finite);
        out.error += fit.squared_error / static_cast<double>(3 * rays);
        out.samples += static_cast<std::int64_t>(fit.samples);
        total.add(fit.gradients);
        rows.push_back(fit.rows(grid));
    }
    std::vector<std::span<float>> spans;
    for (const auto& [name, parameter] : field.parameters()) out.of[name] = at::zeros_like(parameter.detach());
    for (const char* name : field_matrix_names) {
        spans.push_back(mutable_values(out.of.at(name)));
    }
    total.add_to(field.mlp_shape(), spans);
    float* table = out.of.at("encoding.table").mutable_data_ptr<float>();
    for (std::size_t l = 0; l < grid.levels.size(); ++l) {
        hash_grid_add_gradient(grid, static_cast<int>(l), rows, table + grid.levels[l].offset * grid.features);
    }
    return out;
}

// The mean squared error over all grey backgrounds: the loss is quadratic in them and separate in the channels, so the
// two points of Gauss and Legendre give it exactly.
Tensor loss_of(const Tensor& color, const Tensor& transmittance, const Tensor& pixels,
               const PlainBackground& background = {}, double* error = nullptr) {
    const Tensor alpha = pixels.narrow(1, 3, 1);
    if (background) {
        const Tensor behind = torch::tensor({(*background)[0], (*background)[1], (*background)[2]});
        const Tensor target = pixels.narrow(1, 0, 3) * alpha + behind * (1 - alpha);
        const Tensor squares = (color + transmittance.unsqueeze(1) * behind - target).square().mean();
        const Tensor nothing = ((target - behind).abs() <= 0.03).all(1);
        if (error != nullptr) *error = squares.item<double>();
        return squares + 0.05 * (nothing * (1 - transmittance).square()).mean();
    }
    Tensor loss = at::zeros({});
    for (const double behind : {0.5 - std::sqrt(1.0 / 12), 0.5 + std::sqrt(1.0 / 12)}) {
        const Tensor shown = color + transmittance.unsqueeze(1) * behind;
        const Tensor target = pixels.narrow(1, 0, 3) * alpha + behind * (1 - alpha);
        loss = loss + (shown - target).square().mean() / 2;
    }
    return loss;
}

// The same loss through march, composite and autograd.
Gradients reference(const RadianceField& field, const Batch& batch, const PlainBackground& background) {
    MarchOptions march;
    march.step = step;
    Random same(9);  // draws the batch's jitter
    march.jitter = &same;
    march.min_transmittance = min_transmittance;
    const RayBundle rays{batch.origins, batch.directions};
    const Samples samples = sample_visible(field, rays, march).samples;
    const auto medium = field.density(samples.positions);
    const Tensor color = field.color(medium.features, batch.directions.index_select(0, samples.ray));
    const CompositeOut view = composite(samples.start, samples.delta, samples.t, medium.density, color);
    double error = 0;
    const Tensor loss = loss_of(view.color, view.transmittance, batch.pixels, background, &error);
    loss.backward();
    Gradients out{background ? error : loss.item<double>(), samples.size(), {}};
    for (const auto& [name, parameter] : field.parameters()) out.of[name] = parameter.grad();
    return out;
}

TEST(RayPass, EqualsMarchCompositeAndAutograd) {
    HashFieldConfig odd;
    odd.levels = 5;
    odd.features_per_level = 4;
    odd.log2_table_size = 10;
    odd.base_resolution = 4;
    odd.finest_resolution = 40;
    odd.density_hidden = 24;
    odd.feature_size = 7;
    odd.color_hidden = 20;
    odd.sh_degree = 3;
    HashFieldConfig usual;
    usual.log2_table_size = 12;
    usual.finest_resolution = 128;
    for (const HashFieldConfig& config : {usual, odd}) {
        const RadianceField field = lively_field(config);
        const Batch batch(700);
        for (const PlainBackground& background : {PlainBackground(), PlainBackground({0.9f, 0.2f, 0.4f})}) {
            for (const auto& [name, parameter] : field.parameters()) parameter.mutable_grad() = Tensor();
            const Gradients expected = reference(field, batch, background);
            const Gradients found = summed(field, run(field, batch, 128, background), 700);
            EXPECT_GT(expected.samples, 5000);
            EXPECT_EQ(found.samples, expected.samples);
            EXPECT_NEAR(found.error, expected.error, 1e-6);
            for (const auto& [name, gradient] : expected.of) {
                const double worst = (found.of.at(name) - gradient).abs().max().item<double>();
                EXPECT_LT(worst, 2e-4 * gradient.abs().max().item<double>()) << name;
            }
        }
    }
}

TEST(RayPass, DrawsWhatMarchAndCompositeDo) {
    HashFieldConfig config;
    config.log2_table_size = 12;
    config.finest_resolution = 128;
    const RadianceField field = lively_field(config);
    const Batch batch(900);
    const RayBundle rays{batch.origins, batch.directions};
    for (const double least : {1e-4, 0.0}) {
        MarchOptions march;
        march.step = step;
        march.min_transmittance = least;
        const VisibleSamples visible = sample_visible(field, rays, march);
        const Samples& samples = visible.samples;
        at::NoGradGuard no_grad;
        const Tensor color = field.color(visible.features, batch.directions.index_select(0, samples.ray));
        const CompositeOut expected = composite(samples.start, samples.delta, samples.t, visible.density, color);
        RenderOptions options;
        options.march = march;
        const RenderedRays found = render_rays(field, rays, options);
        EXPECT_LT((found.color - expected.color).abs().max().item<double>(), 1e-6);
        EXPECT_LT((found.alpha - (1 - expected.transmittance)).abs().max().item<double>(), 1e-6);
        EXPECT_LT((found.depth - expected.depth).abs().max().item<double>(), 1e-5);
    }
}

TEST(RayPass, RaysThatSeeNothingCostTheirPixels) {
    HashFieldConfig config;
    config.log2_table_size = 10;
    const RadianceField field = lively_field(config);
    Batch batch(64);
    batch.origins.fill_(50);  // and every ray looks at the box's surroundings or away from it
    batch.directions = at::zeros_like(batch.directions);
    batch.directions.select(1, 0).fill_(1);
    const Gradients found = summed(field, run(field, batch, 64), 64);
    EXPECT_EQ(found.samples, 0);
    EXPECT_NEAR(found.error, loss_of(at::zeros({64, 3}), at::ones({64}), batch.pixels).item<double>(), 1e-6);
    for (const auto& [name, gradient] : found.of) EXPECT_EQ(gradient.abs().max().item<double>(), 0) << name;
}

TEST(RayPass, NaNIsSeen) {
    HashFieldConfig config;
    config.log2_table_size = 10;
    const RadianceField field = lively_field(config);
    at::NoGradGuard no_grad;
    field.parameters().at("color.1").fill_(std::numeric_limits<float>::quiet_NaN());
    bool finite = true;
    for (const RangeFit& fit : run(field, Batch(32), 32)) finite = finite && fit.finite;
    EXPECT_FALSE(finite);
}

}  // namespace
}  // namespace fieldgraft
