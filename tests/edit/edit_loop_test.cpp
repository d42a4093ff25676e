// The whole loop on a small field with a tiny random guide: it trains, stops, resumes bit for bit, and keeps to its
// region.
#include "core/edit/edit_loop.h"

#include <gtest/gtest.h>

#include "core/edit/adam.h"
#include "core/edit/metrics.h"
#include "core/edit/vote_grid.h"
#include "tests/base/one_thread.h"
#include "tests/edit/edit_fixtures.h"

namespace fieldgraft {
namespace {

using EditLoop = OneThread;

TEST_F(EditLoop, TrainsAndKeepsToItsRegion) {
    SmallWorld world;
    EditSpec spec = small_spec("change", world.folder.path());
    spec.iterations = 40;
    spec.learning_rate = spec.learning_rate_end = 0.05;
    EditRunOptions options;
    options.preview = world.folder.path() / "preview.png";
    const EditResult result = train_edit(world.inputs, spec, options, Reporter());
    EXPECT_EQ(result.report.iterations, 40);
    EXPECT_EQ(result.report.skipped, 0);
    EXPECT_LT(result.report.loss, result.report.first_loss);
    EXPECT_GT(result.report.changed, 0.1);
    EXPECT_EQ(image_size(options.preview), (std::array<int, 3>{160, 480, 3}));
    // Nothing acts below the masks' edge and its dilations.
    const FieldGeometry& geometry = world.inputs.field->geometry();
    const Tensor support = result.edit.field->support();
    const Tensor low = cell_centres(geometry, static_cast<int>(support.size(0))).select(1, 2) < -0.5;
    EXPECT_FALSE(support.reshape(-1).masked_select(low).to(at::kBool).any().item<bool>());
    EXPECT_GT(support.sum().item<int>(), 0);
    EXPECT_EQ(result.edit.field_hash, world.inputs.field->hash());
    EXPECT_EQ(EditSpec::from_json(result.edit.specification).target, "red ball");
}

TEST_F(EditLoop, AllOperationsTogether) {
    SmallWorld world;
    EditSpec spec = small_spec("add,remove,change", world.folder.path());
    spec.iterations = 3;
    spec.set_weight("global_edit", 0.5);
    spec.background = EditBackground::random;
    spec.fade_levels = 0.5;
    const EditResult result = train_edit(world.inputs, spec, {}, Reporter());
    EXPECT_EQ(result.report.skipped, 0);
    EXPECT_TRUE(result.region.volume.defined());
    EXPECT_GT(result.report.added, 0);
    EXPECT_GT(result.report.removed, 0);
}

TEST_F(EditLoop, StoppedAndResumedIsTheSameAsUninterrupted) {
    SmallWorld world;
    EditSpec spec = small_spec("change,remove", world.folder.path());
    spec.iterations = 6;
    const std::string whole = train_edit(world.inputs, spec, {}, Reporter()).edit.hash();

    EditRunOptions options;
    options.checkpoint = world.folder.path() / "edit.checkpoint.safetensors";
    std::atomic<bool> stop{false};
    const Reporter stopping(
        [&](const Json& event) {
            if (event.value("stage", "") == "edit") stop = true;
        },
        &stop);
    EXPECT_THROW(train_edit(world.inputs, spec, options, stopping), Cancelled);
    ASSERT_TRUE(std::filesystem::exists(options.checkpoint));
    options.resume = true;
    EditSpec other = spec;
    other.target = "red";
    EXPECT_THROW(train_edit(world.inputs, other, options, Reporter()), InputError);
    const EditResult resumed = train_edit(world.inputs, spec, options, Reporter());
    EXPECT_EQ(resumed.report.iterations, 6);
    EXPECT_EQ(resumed.edit.hash(), whole);
    EXPECT_TRUE(std::filesystem::exists(options.checkpoint));  // until the caller has saved the edit
}

TEST_F(EditLoop, RefusesWhatCannotWork) {
    SmallWorld world;
    EditSpec spec = small_spec("change", world.folder.path());
    spec.patch = 64;
    EXPECT_THROW(train_edit(world.inputs, spec, {}, Reporter()), InputError);
    spec = small_spec("change", world.folder.path());
    spec.target = spec.source;
    EXPECT_THROW(train_edit(world.inputs, spec, {}, Reporter()), InputError);
}

TEST(Adam, FirstStepIsTheLearningRateAndBadGradientsAreSkipped) {
    Tensor p = at::tensor({1.0f, -2.0f, 3.0f}).requires_grad_(true);
    Adam adam({{"p", p}});
    p.mutable_grad() = at::tensor({0.5f, -4.0f, 0.0f});
    EXPECT_TRUE(adam.step(0.1));
    EXPECT_TRUE(at::allclose(p.detach(), at::tensor({0.9f, -1.9f, 3.0f})));
    p.mutable_grad() = at::tensor({0.5f, std::numeric_limits<float>::quiet_NaN(), 0.0f});
    const auto before = adam.state().at("v.p").clone();
    EXPECT_FALSE(adam.step(0.1));
    EXPECT_TRUE(at::allclose(p.detach(), at::tensor({0.9f, -1.9f, 3.0f})));
    EXPECT_TRUE(at::equal(adam.state().at("v.p"), before));
    EXPECT_EQ(adam.steps(), 1);
    EXPECT_FALSE(p.grad().defined());
    EXPECT_THROW(adam.restore({}), InputError);
}

TEST(Metrics, ClosedForm) {
    EditedView view{at::zeros({2, 2, 3}), at::zeros({2, 2, 3}), at::tensor({1, 1, 1, 0}).to(at::kBool).reshape({2, 2}),
                    at::tensor({1, 0, 0, 0}).to(at::kBool).reshape({2, 2})};
    view.edited[0][0] = 0.6;
    view.edited[0][1] = 0.3;
    const EditMetrics metrics = measure_edit({view}, nullptr, "a", "b");
    EXPECT_NEAR(metrics.d_l1, 0.9 / 4, 1e-6);
    EXPECT_NEAR(metrics.d_l1_inside, 0.6, 1e-6);
    EXPECT_NEAR(metrics.d_l1_outside, 0.1, 1e-6);
    EXPECT_NEAR(metrics.d_l1_outside_object, 0.15, 1e-6);
    EXPECT_TRUE(std::isnan(metrics.s_clip));
    EXPECT_FALSE(metrics.to_json().contains("s_clip"));
}

TEST(Metrics, JudgeIsAskedAboutBothDirections) {
    TemporaryFolder folder;
    TinyModel model;
    model.config["templates"] = {"{}", "a {}"};
    model.write(folder.path());
    const auto judge = Guidance::load(folder.path());
    Random random(1);
    const Tensor original = uniform_image(random, {32, 32, 3});
    const EditMetrics same = measure_edit({{original, original, {}, {}}}, judge.get(), "ball", "red ball");
    EXPECT_NEAR(same.directional, 0, 1e-6);
    EXPECT_EQ(same.d_l1, 0);
    const EditMetrics moved = measure_edit({{original, 1 - original, {}, {}}}, judge.get(), "ball", "red ball");
    EXPECT_NEAR(moved.s_clip, (moved.similarity + moved.directional) / 2, 1e-12);
    EXPECT_NEAR(moved.mp_clip, (1 - moved.d_l1) * moved.s_clip, 1e-12);
}

}  // namespace
}  // namespace fieldgraft
