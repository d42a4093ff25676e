#include "core/render/march.h"

#include <gtest/gtest.h>

#include <cmath>

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

TEST(Occupancy, UnionAndGrowth) {
    Tensor a = at::zeros({5, 5, 5}, at::kByte), b = a.clone();
    a[0][0][0] = 7;
    b[4][2][1] = 1;
    const Tensor both = union_of(a, b);
    EXPECT_EQ(both.sum().item<std::int64_t>(), 2);
    EXPECT_EQ(both.max().item<int>(), 1);
    EXPECT_EQ(dilated(a, 1).sum().item<std::int64_t>(), 8);
    EXPECT_EQ(dilated(b, 1).sum().item<std::int64_t>(), 2 * 3 * 3);
    EXPECT_EQ(dilated(b, 9).sum().item<std::int64_t>(), 125);
    EXPECT_TRUE(at::equal(dilated(b, 0), b));
    EXPECT_THROW(union_of(a, at::zeros({4, 4, 4}, at::kByte)), std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
