// Where nothing is edited a picture is the field's own, bit for bit: looked for with random fields, edits and rays.
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include "tests/render/edit_fixtures.h"

namespace fieldgraft::stability {
namespace {

const std::vector<std::string> all_operations{"add",        "remove",        "change",           "add,remove",
                                              "add,change", "remove,change", "add,remove,change"};

float any_place() {
    return static_cast<float>(*rc::gen::inRange(-100, 101)) / 100;
}

std::shared_ptr<EditField> any_edit() {
    const std::string operations = *rc::gen::elementOf(all_operations);
    const float radius = static_cast<float>(*rc::gen::inRange(5, 60)) / 100;
    return ball_edit(operations, {any_place(), any_place(), any_place()}, radius, *rc::gen::arbitrary<std::uint32_t>());
}

// Rays from anywhere before the box to anywhere in it.
RayBundle any_rays() {
    std::vector<float> origins, directions;
    const int count = *rc::gen::inRange(1, 24);
    for (int i = 0; i < count; ++i) {
        const std::array<float, 3> from{3 * any_place(), -3.5f, 3 * any_place()},
            to{any_place(), any_place(), any_place()};
        float length = 0;
        for (int a = 0; a < 3; ++a) length += (to[a] - from[a]) * (to[a] - from[a]);
        for (int a = 0; a < 3; ++a) {
            origins.push_back(from[a]);
            directions.push_back((to[a] - from[a]) / std::sqrt(length));
        }
    }
    return {torch::tensor(origins).view({-1, 3}), torch::tensor(directions).view({-1, 3})};
}

BlendOptions any_options() {
    BlendOptions options;
    if (*rc::gen::inRange(0, 2) == 1) options.compositing = Compositing::conserving;
    if (*rc::gen::inRange(0, 2) == 1) options.removed = RemovedMap::visible;
    return options;
}

void check_same(const BlendedRays& out, const RenderedRays& plain, const Tensor& rows) {
    const auto same = [&](const Tensor& a, const Tensor& b) {
        return same_bits(a.index_select(0, rows), b.index_select(0, rows));
    };
    RC_ASSERT(same(out.color, plain.color));
    RC_ASSERT(same(out.alpha, plain.alpha));
    RC_ASSERT(same(out.depth, plain.depth));
    RC_ASSERT(!out.edited.index_select(0, rows).any().item<bool>());
}

TEST(Property, StrengthZeroIsNoEdit) {
    const auto field = ball_field();
    EXPECT_TRUE(rc::check([&] {
        const RayBundle rays = any_rays();
        EditStack stack;
        const int edits = *rc::gen::inRange(0, 3);
        for (int i = 0; i < edits; ++i) stack.push_back({any_edit(), 0, 0, 0});
        BlendedOptions options;
        options.blend = any_options();
        check_same(render_blended_rays(*field, stack, rays, options), render_rays(*field, rays),
                   at::arange(rays.size(), at::kLong));
    }));
}

TEST(Property, RaysThatNoEditTouchesAreTheFieldsOwn) {
    const auto field = ball_field();
    EXPECT_TRUE(rc::check([&] {
        const RayBundle rays = any_rays();
        const EditStack stack{{any_edit()}};
        BlendedOptions options;
        options.blend = any_options();
        const Tensor untouched =
            touched_rays(*field, stack, rays, options.render.march).logical_not().nonzero().squeeze(1);
        check_same(render_blended_rays(*field, stack, rays, options), render_rays(*field, rays), untouched);
    }));
}

}  // namespace
}  // namespace fieldgraft::stability
