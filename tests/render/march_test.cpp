#include "core/render/march.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/field/cells.h"
#include "core/render/blend.h"
#include "tests/render/synthetic_field.h"

namespace fieldgraft {
namespace {

using testing::inward_rays;
using testing::uneven_field;

TEST(March, PacksSamplesByRay) {
    Tensor occupancy = (testing::random_tensor({16, 16, 16}, 1, 0, 1) < 0.2).to(at::kByte);
    const RayBundle rays = inward_rays(300, 2);
    MarchOptions options;
    options.step = 0.01;
    const Samples samples = march({}, occupancy, rays, options);
    ASSERT_GT(samples.size(), 1000);
    ASSERT_EQ(samples.start[300].item<std::int64_t>(), samples.size());
    for (std::int64_t r = 0; r < 300; ++r) {
        const std::int64_t first = samples.start[r].item<std::int64_t>(),
                           last = samples.start[r + 1].item<std::int64_t>();
        if (first == last) continue;
        EXPECT_TRUE(samples.ray.slice(0, first, last).eq(r).all().item<bool>());
        const Tensor t = samples.t.slice(0, first, last);
        EXPECT_TRUE((t.slice(0, 1) > t.slice(0, 0, -1)).all().item<bool>());
    }
    const Tensor points = rays.origins.index_select(0, samples.ray) +
                          samples.t.unsqueeze(1) * rays.directions.index_select(0, samples.ray);
    EXPECT_TRUE(at::allclose(points, samples.positions, 0, 2e-6));
    const Tensor cell = ((samples.positions + 1.5) / 3 * 16).floor().clamp(0, 15).to(at::kLong);
    const Tensor flat = (cell.select(1, 2) * 16 + cell.select(1, 1)) * 16 + cell.select(1, 0);
    EXPECT_GT(occupancy.view(-1).index_select(0, flat).to(at::kFloat).mean().item<float>(), 0.999f);
}

TEST(March, TheDefaultStepAndItsErrors) {
    EXPECT_NEAR(march_step({}, {}), 3 * std::sqrt(3.0) / 1024, 1e-15);
    MarchOptions options;
    options.step = -1;
    EXPECT_THROW(march_step({}, options), std::invalid_argument);
    EXPECT_THROW(march({}, at::zeros({2, 2, 3}, at::kByte), inward_rays(1, 1), {}), std::invalid_argument);
    EXPECT_THROW(march({}, {}, {at::zeros({2, 3}), at::zeros({1, 3})}, {}), std::invalid_argument);
}

TEST(March, JitterComesFromTheGeneratorAndStaysWithinHalfAStep) {
    const RayBundle rays = inward_rays(50, 3);
    MarchOptions options;
    options.step = 0.05;
    const Samples plain = march({}, {}, rays, options);
    Random a(1), b(1);
    options.jitter = &a;
    const Samples one = march({}, {}, rays, options);
    options.jitter = &b;
    const Samples two = march({}, {}, rays, options);
    EXPECT_TRUE(at::equal(one.t, two.t));
    EXPECT_FALSE(one.size() == plain.size() && at::equal(one.t, plain.t));
    const Tensor phase = one.t / 0.05, offset = phase - phase.floor();
    EXPECT_GT(offset.max().item<float>(), 0.9f);
    EXPECT_LT(offset.min().item<float>(), 0.1f);
}

TEST(SampleVisible, KeepsExactlyWhatTheFullMarchShows) {
    RadianceField field = uneven_field();
    field.set_occupancy((testing::random_tensor({16, 16, 16}, 4, 0, 1) < 0.5).to(at::kByte));
    const RayBundle rays = inward_rays(400, 5);
    MarchOptions options;
    options.step = 0.02;
    const Samples all = march(field.geometry(), field.occupancy(), rays, options);
    const Tensor density = field.density(all.positions).density;
    const VisibleSamples visible = sample_visible(field, rays, options);
    ASSERT_LT(visible.samples.size(), all.size());
    for (std::int64_t r = 0; r < rays.size(); ++r) {
        const std::int64_t first = all.start[r].item<std::int64_t>(), last = all.start[r + 1].item<std::int64_t>();
        double depth = 0;
        std::int64_t seen = 0;
        for (std::int64_t k = first; k < last && std::exp(-depth) >= 1e-4; ++k, ++seen) {
            depth += density[k].item<float>() * all.delta[k].item<float>();
        }
        const std::int64_t begin = visible.samples.start[r].item<std::int64_t>();
        ASSERT_EQ(visible.samples.start[r + 1].item<std::int64_t>() - begin, seen) << "ray " << r;
        ASSERT_TRUE(at::equal(visible.samples.t.narrow(0, begin, seen), all.t.narrow(0, first, seen)));
        ASSERT_TRUE(at::allclose(visible.density.narrow(0, begin, seen), density.narrow(0, first, seen), 1e-5, 1e-6));
    }
    const auto again = field.density(visible.samples.positions);
    EXPECT_TRUE(at::allclose(again.features, visible.features, 1e-4, 1e-5));
}

TEST(SampleVisible, AtZeroTransmittanceNothingIsLeftOut) {
    const RadianceField field = uneven_field();
    const RayBundle rays = inward_rays(20, 7);
    MarchOptions options;
    options.step = 0.05;
    options.min_transmittance = 0;
    EXPECT_EQ(sample_visible(field, rays, options).samples.size(), march({}, {}, rays, options).size());
    options.min_transmittance = 1;
    EXPECT_THROW(sample_visible(field, rays, options), std::invalid_argument);
    EXPECT_EQ(sample_visible(field, {at::empty({0, 3}), at::empty({0, 3})}, {}).samples.size(), 0);
}

Tensor middle_cells() {
    Tensor cells = at::zeros({16, 16, 16}, at::kByte);
    cells.slice(0, 5, 9).slice(1, 4, 12).slice(2, 6, 11).fill_(1);
    return cells;
}

// Extra cells are marched beside f's, where f's density is 0; runs of steps there may become one sample.
TEST(SampleVisible, ExtraCellsAndJoinedSteps) {
    RadianceField field = uneven_field();
    field.set_occupancy(middle_cells());
    const RayBundle rays = inward_rays(60, 8);
    EditCells cells;
    cells.extra = at::ones({1, 1, 1}, at::kByte);
    MarchOptions options;
    options.step = 0.01;
    options.min_transmittance = 0;
    const VisibleSamples own = sample_visible(field, rays, options), all = sample_visible(field, rays, options, cells);
    const Samples everywhere = march(field.geometry(), {}, rays, options);
    ASSERT_EQ(all.samples.size(), everywhere.size());
    ASSERT_LT(4 * own.samples.size(), all.samples.size());
    const auto in_field = [&](const VisibleSamples& v) {
        return in_cells(field.geometry(), field.occupancy(), v.samples.positions);
    };
    const Tensor inside = in_field(all);
    EXPECT_EQ(all.density.masked_select(inside.logical_not()).abs().sum().item<float>(), 0);
    EXPECT_TRUE(at::allclose(all.density.masked_select(inside), own.density, 1e-5, 1e-6));
    EXPECT_TRUE(at::equal(all.samples.t.masked_select(inside), own.samples.t));

    cells.extra_stride = 4;
    const VisibleSamples joined = sample_visible(field, rays, options, cells);
    EXPECT_LT(joined.samples.size(), own.samples.size() + (all.samples.size() - own.samples.size()) / 3);
    // Nothing of f is joined, and the lengths still add up to every ray's way through the box.
    EXPECT_TRUE(at::allclose(joined.density.masked_select(in_field(joined)), own.density, 1e-5, 1e-6));
    const auto way = [](const Samples& s) {
        const Tensor none = at::zeros({s.start.size(0) - 1}, at::kDouble);
        return none.index_add(0, s.ray, s.delta.to(at::kDouble));
    };
    EXPECT_TRUE(at::allclose(way(joined.samples), way(everywhere), 1e-5));
    // A joined sample lies in the middle of its steps, and what it covers ends where the next begins.
    const Samples& samples = joined.samples;
    const Tensor begins = samples.t - samples.delta / 2, ends = samples.t + samples.delta / 2;
    const Tensor same_ray = samples.ray.slice(0, 1).eq(samples.ray.slice(0, 0, -1));
    EXPECT_LT((begins.slice(0, 1) - ends.slice(0, 0, -1)).abs().masked_select(same_ray).max().item<float>(), 1e-4f);
    const Tensor there = rays.origins.index_select(0, samples.ray) +
                         samples.t.unsqueeze(1) * rays.directions.index_select(0, samples.ray);
    EXPECT_TRUE(at::allclose(there, samples.positions, 0, 5e-6));
    cells.extra_stride = 0;
    EXPECT_THROW(sample_visible(field, rays, options, cells), std::invalid_argument);
}

TEST(SampleVisible, WhatMayBeTakenAwayHidesNothing) {
    RadianceField field = uneven_field(20);
    const RayBundle rays = inward_rays(60, 9);
    MarchOptions options;
    options.step = 0.02;
    const std::int64_t every = march(field.geometry(), {}, rays, options).size();
    const std::int64_t seen = sample_visible(field, rays, options).samples.size();
    EditCells cells;
    cells.transparent = at::zeros({2, 2, 2}, at::kByte);
    cells.transparent[1].fill_(1);  // the upper half
    const std::int64_t more = sample_visible(field, rays, options, cells).samples.size();
    cells.transparent = at::ones({1, 1, 1}, at::kByte);
    EXPECT_LT(seen, more);
    EXPECT_LT(more, every);
    EXPECT_EQ(sample_visible(field, rays, options, cells).samples.size(), every);
}

TEST(Occupancy, JoinedAtTheFinerResolution) {
    const Tensor coarse = at::zeros({2, 2, 2}, at::kByte), fine = middle_cells();
    coarse[1][1][1].fill_(1);
    EXPECT_TRUE(at::equal(joined_cells(Tensor(), fine), fine));
    const Tensor both = joined_cells(coarse, fine);
    EXPECT_TRUE(at::equal(both, joined_cells(fine, coarse)));
    EXPECT_EQ(both.size(0), 16);
    const std::int64_t shared = fine.slice(0, 8).slice(1, 8).slice(2, 8).sum().item<std::int64_t>();
    ASSERT_GT(shared, 0);
    EXPECT_EQ(both.sum().item<std::int64_t>(), 8 * 8 * 8 + fine.sum().item<std::int64_t>() - shared);
}

}  // namespace
}  // namespace fieldgraft
