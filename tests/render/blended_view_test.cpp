#include "core/base/errors.h"
#include "core/field/edit_support.h"
#include "tests/render/edit_fixtures.h"

namespace fieldgraft {
namespace {

constexpr int size = 24;

BlendedRays render(const std::shared_ptr<RadianceField>& field, const EditStack& stack, BlendOptions blend = {}) {
    BlendedOptions options;
    options.blend = blend;
    return render_blended_rays(*field, stack, front_rays(size), options);
}

Tensor difference(const Tensor& a, const Tensor& b) {
    return (a - b).abs().amax(a.dim() > 1 ? std::vector<std::int64_t>{1} : std::vector<std::int64_t>{});
}

const std::vector<std::string> all_operations{"add",        "remove",        "change",           "add,remove",
                                              "add,change", "remove,change", "add,remove,change"};

TEST(BlendedView, NoEditIsBitExact) {
    const auto field = ball_field();
    const RenderedRays plain = render_rays(*field, front_rays(size));
    ASSERT_GT(plain.alpha.max().item<float>(), 0.5f);  // there is something to see
    const auto edit = ball_edit("add,remove,change", {0, 0, 0}, 0.7f);
    for (const EditStack& stack :
         {EditStack{}, EditStack{{edit, 0, 0, 0}}, EditStack{{edit, 0, 0, 0}, {edit, 0, 0, 0}}}) {
        const BlendedRays out = render(field, stack);
        EXPECT_TRUE(same_bits(out.color, plain.color));
        EXPECT_TRUE(same_bits(out.alpha, plain.alpha));
        EXPECT_TRUE(same_bits(out.depth, plain.depth));
        EXPECT_EQ(out.edited.abs().max().item<float>(), 0);
    }
}

TEST(BlendedView, OutsideTheSupportIsBitExact) {
    const auto field = ball_field();
    const RayBundle rays = front_rays(size);
    const RenderedRays plain = render_rays(*field, rays);
    for (const std::string& operations : all_operations) {
        const EditStack stack{{ball_edit(operations, {0.4f, 0, 0.2f}, 0.35f)}};
        const BlendedRays out = render(field, stack);
        const Tensor touched = touched_rays(*field, stack, rays, {}), rest = touched.logical_not();
        ASSERT_GT(touched.sum().item<std::int64_t>(), 10) << operations;
        ASSERT_GT(rest.sum().item<std::int64_t>(), 200) << operations;
        const Tensor kept = rest.nonzero().squeeze(1), changed = touched.nonzero().squeeze(1);
        EXPECT_TRUE(same_bits(out.color.index_select(0, kept), plain.color.index_select(0, kept))) << operations;
        EXPECT_TRUE(same_bits(out.alpha.index_select(0, kept), plain.alpha.index_select(0, kept))) << operations;
        EXPECT_EQ(out.edited.index_select(0, kept).abs().max().item<float>(), 0);
        EXPECT_GT(difference(out.color, plain.color).index_select(0, changed).max().item<float>(), 0.02f) << operations;
    }
}

// Supports that no ray meets, in the box's empty corner, leave change and remove without effect; add adds there.
TEST(BlendedView, EmptySpaceIsVisitedOnlyForAdd) {
    const auto field = ball_field();
    const RenderedRays plain = render_rays(*field, front_rays(size));
    const std::array<float, 3> corner{1, 0, 1};
    EXPECT_TRUE(same_bits(render(field, {{ball_edit("remove,change", corner, 0.3f)}}).color, plain.color));
    const BlendedRays out = render(field, {{ball_edit("add", corner, 0.3f)}});
    EXPECT_GT(out.added.max().item<float>(), 0.3f);
    EXPECT_NEAR((out.alpha - plain.alpha - out.added).abs().max().item<float>(), 0, 1e-5);
}

// The kernels' way against tensors' (which a colour of the caller's own still takes).
TEST(BlendedView, IsWhatTensorsSay) {
    const auto field = ball_field();
    BlendedOptions fast, by_tensors;
    by_tensors.color = [&](const Tensor& features, const Tensor&, const Tensor& directions) {
        return field->color(features, directions);
    };
    for (const std::string& operations : all_operations) {
        const auto edit = ball_edit(operations, {0.3f, 0, 0.1f}, 0.5f);
        const auto other = ball_edit("add,remove,change", {-0.2f, 0.1f, 0}, 0.6f, 11);
        for (const EditStack& stack :
             {EditStack{{edit}}, EditStack{{edit, 0.6f, 0.7f, 0.8f}, {other, 0.5f, 1, 0.9f}}}) {
            for (const Compositing rule : {Compositing::paper, Compositing::conserving}) {
                fast.blend = by_tensors.blend = {rule, RemovedMap::visible};
                const BlendedRays a = render_blended_rays(*field, stack, front_rays(size), fast);
                const BlendedRays b = render_blended_rays(*field, stack, front_rays(size), by_tensors);
                EXPECT_GT(a.edited.max().item<float>(), 0.05f) << operations;
                for (const auto part : {&BlendedRays::color, &BlendedRays::alpha, &BlendedRays::depth,
                                        &BlendedRays::color_edit, &BlendedRays::alpha_edit, &BlendedRays::added,
                                        &BlendedRays::removed, &BlendedRays::changed, &BlendedRays::edited}) {
                    EXPECT_LT((a.*part - b.*part).abs().max().item<float>(), 3e-4f) << operations;
                }
            }
        }
    }
}

TEST(BlendedView, DoesNotDependOnWhichRaysAreDrawnTogether) {
    const auto field = ball_field();
    const EditStack stack{{ball_edit("add,remove,change", {0.3f, 0, 0.1f}, 0.5f)}};
    BlendedOptions options;
    options.blend.removed = RemovedMap::visible;
    const RayBundle rays = front_rays(size);
    const Tensor half = at::arange(0, rays.size(), 2, at::kLong);
    const RayBundle some{rays.origins.index_select(0, half), rays.directions.index_select(0, half)};
    const BlendedRays all = render_blended_rays(*field, stack, rays, options);
    const BlendedRays part = render_blended_rays(*field, stack, some, options);
    EXPECT_TRUE(same_bits(all.color.index_select(0, half), part.color));
    EXPECT_TRUE(same_bits(all.removed.index_select(0, half), part.removed));
}

TEST(BlendedView, ChangeKeepsTheGeometry) {
    const auto field = ball_field();
    const RenderedRays plain = render_rays(*field, front_rays(size));
    const BlendedRays out = render(field, {{ball_edit("change", {0, 0, 0}, 2)}});
    EXPECT_NEAR((out.alpha - plain.alpha).abs().max().item<float>(), 0, 1e-6);
    EXPECT_GT(difference(out.color, plain.color).max().item<float>(), 0.05f);
    // Where everything may change, what changed is the map's share of what can be seen.
    EXPECT_LE((out.changed - out.alpha).max().item<float>(), 1e-6);
    EXPECT_TRUE(at::allclose(out.changed, out.alpha_edit, 0, 1e-6));
}

TEST(BlendedView, StrengthsAreContinuousFromTheOriginalOn) {
    const auto field = ball_field();
    const RenderedRays plain = render_rays(*field, front_rays(size));
    const auto edit = ball_edit("add,remove,change", {0, 0, 0}, 0.5f);
    const auto at_strength = [&](float s) { return render(field, {{edit, s, s, s}}).color; };
    double before = 0;
    for (const float s : {1e-6f, 1e-4f, 1e-2f, 0.1f, 1.0f}) {
        const double change = difference(at_strength(s), plain.color).max().item<double>();
        EXPECT_LE(change, std::max(40.0 * s, 2e-6)) << s;
        EXPECT_GE(change, before * 0.9) << s;
        before = change;
    }
    EXPECT_GT(before, 0.05);
    // One strength at a time: add 0 is the edit without its density.
    const BlendedRays partial = render(field, {{edit, 0, 1, 1}});
    EXPECT_EQ(partial.added.max().item<float>(), 0);
    EXPECT_GT(partial.changed.max().item<float>(), 0.05f);
}

// Both rules agree as the step goes to 0.
TEST(BlendedView, CompositingRulesMeetAtSmallSteps) {
    const auto field = ball_field();
    const EditStack stack{{ball_edit("add,change", {0, 0, 0}, 0.7f)}};
    double gaps[2];
    for (int i = 0; i < 2; ++i) {
        BlendedOptions options;
        options.render.march.step = i == 0 ? 0.08 : 0.01;
        options.blend.compositing = Compositing::paper;
        const Tensor paper = render_blended_rays(*field, stack, front_rays(size), options).color;
        options.blend.compositing = Compositing::conserving;
        gaps[i] =
            (paper - render_blended_rays(*field, stack, front_rays(size), options).color).abs().mean().item<double>();
    }
    EXPECT_GT(gaps[0], 0);
    EXPECT_NEAR(gaps[0] / gaps[1], 8, 2.5);
}

TEST(BlendedView, RemovingEverythingUncoversTheBackground) {
    const auto field = ball_field();
    auto edit = ball_edit("remove", {0, 0, 0}, 2);
    {
        at::NoGradGuard no_grad;
        edit->parameters().at("beta_density.weight").zero_();
        edit->parameters().at("beta_density.bias").fill_(1000);  // the bound: β = sigmoid(8)
    }
    const BlendedRays out = render(field, {{edit}}, {Compositing::paper, RemovedMap::visible});
    EXPECT_LT(out.alpha.max().item<float>(), 0.05f);
    const Tensor hit = render_rays(*field, front_rays(size)).alpha.gt(0.5).nonzero().squeeze(1);
    EXPECT_GT(out.removed.index_select(0, hit).min().item<float>(), 0.99f);
}

// Under `conserving` a stack of two is blend() of the second over the first one's medium; supports apart commute.
TEST(BlendedView, StackOfTwo) {
    const auto field = ball_field();
    const auto left = ball_edit("change", {-0.4f, 0, 0}, 0.3f, 1),
               right = ball_edit("add,remove", {0.4f, 0, 0}, 0.3f, 2);
    const Tensor both = render(field, {{left}, {right}}).color, swapped = render(field, {{right}, {left}}).color;
    EXPECT_NEAR((both - swapped).abs().max().item<float>(), 0,
                2e-3);  // paper's rule against the mixture, supports apart
    const Tensor alone = render(field, {{left}}).color, plain = render_rays(*field, front_rays(size)).color;
    const Tensor rays_left = touched_rays(*field, {{left}}, front_rays(size), {});
    const Tensor rays_right = touched_rays(*field, {{right}}, front_rays(size), {});
    const Tensor only_left = rays_left.logical_and(rays_right.logical_not()).nonzero().squeeze(1);
    ASSERT_GT(only_left.size(0), 5);
    EXPECT_NEAR((both - alone).index_select(0, only_left).abs().max().item<float>(), 0, 1e-6);

    const auto over = ball_edit("change", {0, 0, 0}, 2, 3);  // repaints what the first left
    const BlendedRays stacked = render(field, {{right}, {over}}, {Compositing::conserving, RemovedMap::visible});
    const BlendedRays first = render(field, {{right}}, {Compositing::conserving, RemovedMap::visible});
    EXPECT_NEAR((stacked.alpha - first.alpha).abs().max().item<float>(), 0, 1e-5);  // change keeps the geometry below
    EXPECT_GT((stacked.color - first.color).abs().max().item<float>(), 0.05f);
    EXPECT_GE((stacked.edited - stacked.changed).min().item<float>(), -1e-6f);
    EXPECT_GT((stacked.edited - stacked.changed).max().item<float>(), 0.01f);  // the lower edit's maps count too
}

TEST(BlendedView, SwitchingOffTheUpperEditGivesTheLower) {
    const auto field = ball_field();
    const auto a = ball_edit("add,remove,change", {0, 0, 0}, 0.5f, 1), b = ball_edit("change", {0, 0, 0}, 0.7f, 2);
    EXPECT_TRUE(same_bits(render(field, {{a}, {b, 0, 0, 0}}).color, render(field, {{a}}).color));
}

TEST(BlendedView, ChunksDoNotChangeThePicture) {
    const auto field = ball_field();
    const EditStack stack{{ball_edit("add,remove,change", {0, 0, 0}, 0.5f)}};
    BlendedOptions options;
    const Tensor whole = render_blended_rays(*field, stack, front_rays(size), options).color;
    options.render.chunk_rays = 333;
    EXPECT_TRUE(at::allclose(whole, render_blended_rays(*field, stack, front_rays(size), options).color, 0, 1e-5));
}

TEST(Medium, MixtureIsExactWhereNothingIsEdited) {
    const Medium below{torch::tensor({0.0f, 2.7f, 1e5f}),
                       torch::tensor({{0.1f, 0.2f, 0.3f}, {0.7f, 0.9f, 0.3f}, {1.f, 0.f, .5f}})};
    const EditSamples nothing{at::zeros({3}), at::full({3, 3}, 0.35f), at::zeros({3}), at::zeros({3})};
    const Medium same = blended_medium(below, nothing);
    EXPECT_TRUE(same_bits(same.density, below.density));
    EXPECT_TRUE(same_bits(same.color, below.color));
    const EditSamples half{torch::tensor({1.0f, 1.35f, 0.0f}), at::full({3, 3}, 1.0f), at::full({3}, 0.5f),
                           at::zeros({3})};
    const Medium mixed = blended_medium(below, half);
    EXPECT_TRUE(at::allclose(mixed.density, torch::tensor({1.0f, 2.7f, 5e4f})));
    EXPECT_TRUE(at::allclose(mixed.color[0], at::ones({3})));  // all of it is g's
    EXPECT_TRUE(at::allclose(mixed.color[1], (below.color[1] + 1) / 2));
}

TEST(Medium, WrongStacksAreRefused) {
    const auto field = ball_field();
    const auto edit = ball_edit("change", {0, 0, 0}, 1);
    EXPECT_THROW(check_stack(*field, {{nullptr}}), std::invalid_argument);
    EXPECT_THROW(check_stack(*field, {{edit, 1, 1, 1.5f}}), std::invalid_argument);
    FieldGeometry other;
    other.box_max = {2, 2, 2};
    EditFieldConfig config;
    config.operations.change = true;
    EXPECT_THROW(check_stack(*field, {{std::make_shared<EditField>(config, other, 1)}}), std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
