// The colour that g starts with is the guide's choice of the palette, and g has it everywhere.
#include "core/edit/first_color.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/edit/patch_source.h"
#include "core/field/edit_support.h"
#include "tests/base/one_thread.h"
#include "tests/edit/edit_fixtures.h"

namespace fieldgraft {
namespace {

using FirstColor = OneThread;

TEST_F(FirstColor, ThePaletteHasThreeLevelsAChannel) {
    auto palette = first_color_palette();
    EXPECT_EQ(palette.size(), 27u);
    std::sort(palette.begin(), palette.end());
    EXPECT_EQ(std::unique(palette.begin(), palette.end()), palette.end());
    for (const auto& color : palette)
        for (const float value : color) EXPECT_TRUE(value > 0 && value < 1);
}

TEST_F(FirstColor, AFieldStartsInIt) {
    EditFieldConfig config;
    config.operations = Operations::parse("add,change");
    EditField edit(config, FieldGeometry{}, 4);
    edit.set_first_color({0.9f, 0.1f, 0.5f});
    const Tensor positions = at::rand({500, 3}) * 2 - 1;
    const Tensor color = edit.evaluate(positions).color_e.detach();
    EXPECT_LT((color.mean(0) - at::tensor({0.9f, 0.1f, 0.5f})).abs().max().item<float>(), 0.05f);
    config.operations = Operations::parse("remove");
    EXPECT_THROW(EditField(config, FieldGeometry{}, 4).set_first_color({0.5f, 0.5f, 0.5f}), std::logic_error);
}

// Every colour of the palette tried by hand: the chosen one has the least loss.
TEST_F(FirstColor, TheGuidesChoiceHasTheLeastLoss) {
    SmallWorld world;
    for (const char* operations : {"change", "add"}) {
        const EditSpec spec = small_spec(operations, world.folder.path());
        const EditPlan plan = EditPlan::compile(spec);
        const BaseMedium base(world.inputs.field, {});
        EditCameras cameras(base.geometry(), spec, &world.scene);
        const EditRegion region = find_region(base, *world.inputs.guide, spec, plan, cameras, &world.scene, Reporter());
        PatchSource source(base, cameras, spec, plan, region, *world.inputs.guide);
        const std::vector<FrozenPatch> patches{source.patch(0), source.patch(1)};
        ASSERT_GT(patches[0].acting.size(0), 0);
        const TextObjective text(world.inputs.guide, spec, plan);
        const double edge = longest_edge(base.geometry());
        const auto chosen = best_first_color(patches, text, spec, plan, edge, Random(3));
        EXPECT_EQ(best_first_color(patches, text, spec, plan, edge, Random(3)), chosen);

        std::array<float, 3> best{};
        double least = 1e9;
        for (const auto& color : first_color_palette()) {
            Random random(3);
            double loss = 0;
            for (const FrozenPatch& patch : patches) {
                const std::int64_t count = patch.samples();
                const auto at_acting = [&](double value) {
                    return at::zeros({count}).index_fill(0, patch.acting, value);
                };
                EditSamples g;
                if (plan.operations.add) g.density_e = at_acting(64 / edge);
                if (plan.operations.change) g.beta_color = at_acting(1);
                g.color_e = at::tensor(at::ArrayRef<float>(color)).expand({count, 3});
                const Tensor white = at::ones({3});
                const RenderedEdit r = render_samples(g, patch, plan, {spec.compositing, spec.removed}, white);
                const TextTerms terms = text.evaluate({patch.over(white), r.blended, r.edit}, white, random);
                if (terms.dir.defined()) loss += plan.weight("dir") * terms.dir.item<double>();
                if (terms.global.defined()) loss += plan.weight("global") * terms.global.item<double>();
                if (terms.global_edit.defined()) loss += plan.weight("global_edit") * terms.global_edit.item<double>();
            }
            if (loss < least) least = loss, best = color;
        }
        EXPECT_EQ(chosen, best) << operations;
    }
}

}  // namespace
}  // namespace fieldgraft
