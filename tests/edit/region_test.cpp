// Where an edit acts: the base sampled as the renderer draws it, masks fused in 3D, the cells for added density.
#include <gtest/gtest.h>

#include "core/edit/patch_source.h"
#include "core/edit/ray_sums.h"
#include "core/edit/volume_cells.h"
#include "core/edit/vote_grid.h"
#include "core/render/render_view.h"
#include "tests/edit/edit_fixtures.h"

namespace fieldgraft {
namespace {

TEST(RaySums, AgreeWithClosedForms) {
    // Two rays: three samples of depth 0.5, 1, 2, and an opaque one before another; a third is empty.
    const Tensor start = at::tensor({0, 3, 5, 5}, at::kLong), ray = at::tensor({0, 0, 0, 1, 1}, at::kLong);
    const Tensor delta = at::full({5}, 0.5f), density = at::tensor({1.0f, 2.0f, 4.0f, 1e30f, 1.0f});
    const Tensor before = transmittance_before(start, ray, delta, density);
    const std::vector<double> expected{1, std::exp(-0.5), std::exp(-1.5), 1, 0};
    for (int i = 0; i < 5; ++i) EXPECT_NEAR(before[i].item<double>(), expected[i], 1e-6) << i;
    const Tensor sums = sum_over_rays(sample_weights(start, ray, delta, density), ray, 3);
    EXPECT_NEAR(sums[0].item<double>(), 1 - std::exp(-3.5), 1e-6);
    EXPECT_EQ(sums[1].item<float>(), 1.0f);
    EXPECT_EQ(sums[2].item<float>(), 0.0f);
}

TEST(BaseMedium, LooksLikeTheRenderersPicture) {
    const auto field = small_field();
    const BaseMedium base(field, {});
    const Rays rays = rays_of_view(small_cameras()[0]);
    const BaseSamples samples = base.sample({rays.origins, rays.directions}, {});
    const Tensor weight =
        sample_weights(samples.samples.start, samples.samples.ray, samples.samples.delta, samples.density);
    const Tensor color = sum_over_rays(weight.unsqueeze(1) * samples.color, samples.samples.ray, rays.size());
    const RenderedRays expected = render_rays(*field, {rays.origins, rays.directions});
    EXPECT_GT(expected.alpha.max().item<float>(), 0.3f);
    EXPECT_LT((color - expected.color).abs().max().item<float>(), 2e-4f);
}

TEST(Region, MasksActFromEveryCamera) {
    SmallWorld world;
    const EditSpec spec = small_spec("change", world.folder.path());
    const EditPlan plan = EditPlan::compile(spec);
    const BaseMedium base(world.inputs.field, {});
    const EditCameras cameras(base.geometry(), spec, &world.scene);
    const EditRegion region = find_region(base, *world.inputs.guide, spec, plan, cameras, &world.scene, Reporter());
    const Tensor points = at::tensor({0.0f, 0.0f, 0.7f, 0.0f, 0.0f, -0.7f, 0.5f, 0.0f, 0.5f}).reshape({3, 3});
    const Tensor score = sample_grid(region.score, base.geometry(), points);
    EXPECT_GT(score[0].item<float>(), 0.5f);
    EXPECT_LT(score[1].item<float>(), 0.5f);
    EXPECT_GT(score[2].item<float>(), 0.5f);
    EXPECT_GT(region.share, 0.2);
    EXPECT_LT(region.share, 0.8);

    // A view that no mask was drawn in.
    PatchSource source(base, cameras, spec, plan, region, *world.inputs.guide);
    const FrozenPatch patch = source.patch(0);
    const double inside = patch.masks.positive.sum().item<double>();
    EXPECT_GT(inside, 0);
    EXPECT_LT(inside, 0.8 * 24 * 24);
    EXPECT_FALSE(patch.masks.positive.logical_and(patch.masks.negative).any().item<bool>());
    // The same number gives the same patch, made or kept.
    PatchSource other(base, cameras, spec, plan, region, *world.inputs.guide);
    for (int again = 0; again < 2; ++again) {
        const FrozenPatch same = other.patch(0);
        EXPECT_TRUE(at::equal(same.positions, patch.positions));
        EXPECT_TRUE(at::equal(same.color, patch.color));
        EXPECT_TRUE(at::equal(same.acting, patch.acting));
    }
}

TEST(PackedPatch, GivesBackWhatItWasMadeOf) {
    SmallWorld world;
    const BaseMedium base(world.inputs.field, {});
    EditSpec spec = small_spec("add,change", world.folder.path());
    const EditPlan plan = EditPlan::compile(spec);
    const EditCameras cameras(base.geometry(), spec, &world.scene);
    EditRegion region;
    const PatchSource source(base, cameras, spec, plan, region, *world.inputs.guide);
    const Camera camera = cameras.survey(1, 24)[0];
    FrozenPatch patch = source.view(camera, 24);
    patch.acting = at::arange(1, patch.samples(), 3, at::kLong);
    const Rays rays = rays_of_view(square(camera, 24));
    const PackedPatch packed(patch, {rays.origins, rays.directions});
    const FrozenPatch back = packed.unpacked();
    ASSERT_GT(patch.samples(), 1000);
    EXPECT_TRUE(at::allclose(back.positions, patch.positions, 0, 2e-6));
    EXPECT_TRUE(at::allclose(back.color, patch.color, 5e-4, 1e-7));
    for (const auto& [now, before] : {std::pair{back.start, patch.start},
                                      {back.delta, patch.delta},
                                      {back.density, patch.density},
                                      {back.acting, patch.acting},
                                      {back.image, patch.image},
                                      {back.opacity, patch.opacity}})
        EXPECT_TRUE(at::equal(now, before));
    EXPECT_EQ(back.size, 24);
    const std::size_t pixels = 24 * 24 * 64;
    EXPECT_LT(packed.bytes(), static_cast<std::size_t>(20 * patch.samples()) + pixels);
}

TEST(Region, SaysWhatIsWrongWithAMask) {
    SmallWorld world;
    EditSpec spec = small_spec("change", world.folder.path());
    const EditPlan plan = EditPlan::compile(spec);
    const BaseMedium base(world.inputs.field, {});
    const EditCameras cameras(base.geometry(), spec, &world.scene);
    const auto complaint = [&](const Scene* scene) {
        return message_of<InputError>(
            [&] { find_region(base, *world.inputs.guide, spec, plan, cameras, scene, Reporter()); });
    };
    EXPECT_NE(complaint(nullptr).find("--scene"), std::string::npos);
    write_png(spec.masks[0].file, at::zeros({48, 48}));
    EXPECT_NE(complaint(&world.scene).find("empty"), std::string::npos);
    write_png(spec.masks[0].file, at::ones({48, 20}));
    EXPECT_NE(complaint(&world.scene).find("20x48"), std::string::npos);
    spec.masks[0].view = "view_9";
    EXPECT_NE(complaint(&world.scene), "");
}

TEST(Volume, AboveStandsOnTheTop) {
    FieldGeometry geometry;
    const Tensor centres = cell_centres(geometry, 32);
    const Tensor region = (centres.norm(2, {1}) < 0.6).reshape({32, 32, 32});
    const Tensor above = cells_above(geometry, region, 0.5);
    const Tensor chosen = centres.index({above.reshape(-1).to(at::kBool)});
    ASSERT_GT(chosen.size(0), 10);
    EXPECT_GT(chosen.select(1, 2).min().item<float>(), 0.4f);
    EXPECT_LT(chosen.slice(1, 0, 2).norm(2, {1}).max().item<float>(), 0.35f);
    EXPECT_THROW(cells_above(geometry, at::zeros_like(region), 0.5), std::invalid_argument);
}

TEST(VolumeCells, SpecksAreTakenAway) {
    Tensor cells = at::zeros({12, 12, 12}, at::kByte);
    cells.slice(0, 1, 6).slice(1, 1, 6).slice(2, 1, 6).fill_(1);  // 125 cells
    cells[6][6][6] = 1;                                           // touches it by a corner
    cells.slice(0, 9, 11).slice(1, 9, 11).slice(2, 9, 11).fill_(1);
    cells[0][11][0] = 1;
    Tensor expected = cells.clone();
    expected[0][11][0] = 0;
    EXPECT_TRUE(at::equal(without_specks(cells, 0.02), expected));
    EXPECT_EQ(without_specks(cells, 0.5).sum().item<int>(), 126);
    EXPECT_TRUE(at::equal(without_specks(cells > 0, 0), cells));
    EXPECT_EQ(without_specks(at::zeros({4, 4, 4}, at::kByte), 0.1).sum().item<int>(), 0);
}

TEST(VolumeCells, WhatLosesItsHoldIsFound) {
    Tensor plate = at::zeros({12, 12, 12}, at::kByte), body = at::zeros_like(plate), hole = at::zeros_like(plate);
    plate.select(0, 2).fill_(1);
    body.slice(0, 3, 9).slice(1, 2, 9).slice(2, 2, 9).fill_(1);  // stands on the plate
    hole[2][11][11] = 1;                                         // of the plate, but not recognised as such
    const Tensor whole = plate.logical_or(body), found = plate.logical_and(hole == 0);
    EXPECT_TRUE(at::equal(cut_off_pieces(whole, found, 0.05), hole));
    EXPECT_EQ(cut_off_pieces(whole, found, 0).sum().item<int>(), 0);
    EXPECT_EQ(cut_off_pieces(whole, body, 0.05).sum().item<int>(), 0);
}

}  // namespace
}  // namespace fieldgraft
