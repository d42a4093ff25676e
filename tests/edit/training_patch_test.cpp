// What an edit is trained on is what is drawn of it later: patches equal pictures, for every combination of operations.
#include <gtest/gtest.h>

#include "core/edit/base_medium.h"
#include "core/edit/edit_plan.h"
#include "core/edit/edit_render.h"
#include "tests/render/edit_fixtures.h"

namespace fieldgraft {
namespace {

constexpr int size = 24;

FrozenPatch patch_of(const BaseMedium& base, const EditField& top, int extra_stride) {
    const Operations& on = top.config().operations;
    BaseQuery query;
    if (on.add) query.extra_cells = top.support();
    query.acting_cells = top.support();
    query.removable = on.remove;
    query.extra_stride = extra_stride;
    const BaseSamples samples = base.sample(front_rays(size), query);
    EXPECT_FALSE(samples.color.requires_grad());
    FrozenPatch patch;
    patch.size = size;
    patch.start = samples.samples.start;
    patch.positions = samples.samples.positions;
    patch.delta = samples.samples.delta;
    patch.density = samples.density;
    patch.color = samples.color;
    patch.acting = samples.acting.nonzero().squeeze(1);
    return patch;
}

EditPlan plan_of(const Operations& operations) {
    EditSpec spec = EditSpec::from_preset("paper-hash", operations);
    spec.source = "ball";
    spec.target = "red ball";
    return EditPlan::compile(spec);
}

TEST(TrainingPatch, EqualsThePicture) {
    const auto field = ball_field();
    const auto below = ball_edit("change,add", {0.2f, 0, 0}, 0.4f, 5);
    EditFile file;
    file.field = below;
    file.field_hash = field->hash();
    const BaseMedium base(field, {file});
    for (const char* operations :
         {"add", "remove", "change", "add,remove", "add,change", "remove,change", "add,remove,change"}) {
        const StackItem top{ball_edit(operations, {0, 0, 0}, 0.5f)};
        const BlendOptions blend{Compositing::paper, RemovedMap::visible};
        BlendedOptions options;
        options.blend = blend;
        const BlendedRays picture = render_blended_rays(*field, {{below}, top}, front_rays(size), options);
        const EditPlan plan = plan_of(top.field->config().operations);
        const auto rendered = [&](int stride) {
            return render_edit(*top.field, patch_of(base, *top.field, stride), plan, blend, at::zeros({3}));
        };
        const auto apart = [&](const RenderedEdit& patch) {
            return (patch.blended.detach().reshape({-1, 3}) - picture.color).abs();
        };
        const RenderedEdit exact = rendered(1);
        EXPECT_LE(apart(exact).max().item<float>(), 3e-4f) << operations;
        // Longer steps where f is not: what is added there is a little coarser.
        EXPECT_LE(apart(rendered(4)).mean().item<float>(), 2e-3f) << operations;

        exact.blended.sum().backward();
        for (const auto& [name, parameter] : top.field->parameters()) {
            ASSERT_TRUE(parameter.grad().defined()) << operations << " " << name;
            EXPECT_TRUE(parameter.grad().isfinite().all().item<bool>()) << operations << " " << name;
            EXPECT_GT(parameter.grad().abs().sum().item<float>(), 0) << operations << " " << name;
        }
        for (const auto& [name, parameter] : below->parameters()) EXPECT_FALSE(parameter.grad().defined());
    }
}

}  // namespace
}  // namespace fieldgraft
