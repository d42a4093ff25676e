#include <gtest/gtest.h>

#include "core/render/blend.h"

namespace fieldgraft {
namespace {

struct Case {
    Tensor start, delta, density_o, color_o;
    EditSamples edit;
};

Tensor numbers(at::IntArrayRef shape, double low, double high, at::ScalarType type, int salt) {
    const std::int64_t count = c10::multiply_integers(shape);
    const Tensor unit = ((at::arange(count, at::kDouble) + 1) * (0.6180339887 + 0.01 * salt)).frac();
    return (unit * (high - low) + low).to(type).view(shape);
}

Case make_case(const std::string& operations, at::ScalarType type) {
    const Operations on = Operations::parse(operations);
    Case c;
    c.start = torch::tensor({0, 3, 3, 8}, at::kLong);  // the middle ray is empty
    c.delta = numbers({8}, 0.05, 0.3, type, 1);
    c.density_o = numbers({8}, 0.1, 4, type, 2);
    c.color_o = numbers({8, 3}, 0, 1, type, 3);
    const auto leaf = [](const Tensor& t) { return t.clone().requires_grad_(true); };
    if (on.add) c.edit.density_e = leaf(numbers({8}, 0.1, 3, type, 4));
    if (on.add || on.change) c.edit.color_e = leaf(numbers({8, 3}, 0, 1, type, 5));
    if (on.remove) c.edit.beta_density = leaf(numbers({8}, 0, 1, type, 6));
    if (on.change) c.edit.beta_color = leaf(numbers({8}, 0, 1, type, 7));
    return c;
}

BlendOut run(const Case& c, const BlendOptions& options = {}) {
    return blend(c.start, c.delta, c.density_o, c.color_o, c.edit, options);
}

// The equations once more in torch operations, for one ray: autograd is the reference for the gradients.
Tensor color_in_torch(const Case& c, std::int64_t from, std::int64_t to, bool conserving) {
    const auto cut = [&](const Tensor& t) { return t.slice(0, from, to); };
    const Tensor delta = cut(c.delta);
    const Tensor kept = cut(c.density_o) * (1 - cut(c.edit.beta_density)) * delta,
                 added = cut(c.edit.density_e) * delta;
    const Tensor both = kept + added, front = both.cumsum(0) - both, t = at::exp(-front);
    const Tensor alpha = 1 - at::exp(-both);
    const Tensor wo = t * (conserving ? alpha * kept / both : 1 - at::exp(-kept));
    const Tensor we = t * (conserving ? alpha * added / both : 1 - at::exp(-added));
    const Tensor beta = cut(c.edit.beta_color).unsqueeze(1), ce = cut(c.edit.color_e);
    const Tensor blended = (1 - beta) * cut(c.color_o) + beta * ce;
    return (wo.unsqueeze(1) * blended + we.unsqueeze(1) * ce).sum(0);
}

TEST(BlendAutograd, AgreesWithTorchOperations) {
    for (const bool conserving : {false, true}) {
        Case c = make_case("add,remove,change", at::kDouble);
        const BlendOut out = run(c, {conserving ? Compositing::conserving : Compositing::paper, RemovedMap::paper});
        const Tensor expected = at::stack(
            {color_in_torch(c, 0, 3, conserving), at::zeros(3, at::kDouble), color_in_torch(c, 3, 8, conserving)});
        EXPECT_TRUE(at::allclose(out.color, expected, 1e-12, 1e-13));
        const std::vector<Tensor> heads{c.edit.density_e, c.edit.color_e, c.edit.beta_density, c.edit.beta_color};
        const Tensor weight = numbers({3, 3}, -1, 1, at::kDouble, 9);
        const auto ours = torch::autograd::grad({(out.color * weight).sum()}, heads);
        const auto right = torch::autograd::grad({(expected * weight).sum()}, heads);
        for (std::size_t i = 0; i < heads.size(); ++i) {
            EXPECT_TRUE(at::allclose(ours[i], right[i], 1e-10, 1e-12)) << "head " << i << "\n" << ours[i] << right[i];
        }
    }
}

TEST(BlendAutograd, OnlyWhatTheOperationsHaveExists) {
    for (const std::string operations :
         {"add", "remove", "change", "add,remove", "add,change", "remove,change", "add,remove,change"}) {
        const Operations on = Operations::parse(operations);
        const BlendOut out = run(make_case(operations, at::kFloat));
        EXPECT_EQ(out.added.defined(), on.add) << operations;
        EXPECT_EQ(out.removed.defined(), on.remove) << operations;
        EXPECT_EQ(out.changed.defined(), on.change) << operations;
        EXPECT_EQ(out.color_edit.defined(), on.add || on.change) << operations;
        EXPECT_EQ(out.alpha_edit.defined(), on.add || on.change) << operations;
        EXPECT_EQ(out.color.sizes(), (std::vector<std::int64_t>{3, 3}));
        EXPECT_EQ(out.transmittance[1].item<float>(), 1);  // the ray without samples
    }
}

TEST(BlendAutograd, MapsReachOnlyTheirOwnHead) {
    const Case c = make_case("add,remove,change", at::kDouble);
    const std::vector<Tensor> heads{c.edit.density_e, c.edit.color_e, c.edit.beta_density, c.edit.beta_color};
    for (const auto& [map, own] : {std::pair{0, 0}, {1, 2}, {2, 3}}) {
        const BlendOut out = run(c);
        const Tensor value = map == 0 ? out.added : map == 1 ? out.removed : out.changed;
        const auto grads = torch::autograd::grad({value.sum()}, heads);
        for (int head = 0; head < 4; ++head) {
            const double size = grads[head].abs().sum().item<double>();
            if (head == own)
                EXPECT_GT(size, 1e-3) << map;
            else
                EXPECT_EQ(size, 0) << "map " << map << " leaks into head " << head;
        }
    }
}

TEST(BlendAutograd, NothingFlowsToTheField) {
    Case c = make_case("change", at::kFloat);
    c.density_o.requires_grad_(true);
    c.color_o.requires_grad_(true);
    run(c).color.sum().backward();
    EXPECT_FALSE(c.density_o.grad().defined());
    EXPECT_FALSE(c.color_o.grad().defined());
    EXPECT_TRUE(c.edit.beta_color.grad().defined());
}

TEST(BlendAutograd, ChangeAloneHasTheFieldsTransmittanceBitForBit) {
    for (const auto type : {at::kFloat, at::kDouble}) {
        const Case c = make_case("change", type);
        const CompositeOut plain = composite(c.start, c.delta, at::cumsum(c.delta, 0), c.density_o, c.color_o);
        EXPECT_TRUE(at::equal(run(c).transmittance.detach(), plain.transmittance));
    }
}

TEST(BlendAutograd, NoRaysAndNoSamples) {
    for (const std::int64_t rays : {0, 4}) {
        EditSamples edit;
        edit.beta_density = at::empty({0}).requires_grad_(true);
        const BlendOut out =
            blend(at::zeros({rays + 1}, at::kLong), at::empty({0}), at::empty({0}), at::empty({0, 3}), edit, {});
        EXPECT_EQ(out.color.sizes(), (std::vector<std::int64_t>{rays, 3}));
        EXPECT_TRUE(at::equal(out.transmittance, at::ones({rays})));
        (out.color.sum() + out.removed.sum()).backward();
        EXPECT_EQ(edit.beta_density.grad().numel(), 0);
    }
}

TEST(BlendAutograd, ThreadsDoNotChangeTheBits) {
    const std::int64_t rays = 2000;
    EditSamples edit{numbers({rays * 5}, 0, 3, at::kFloat, 1), numbers({rays * 5, 3}, 0, 1, at::kFloat, 2), {}, {}};
    edit.density_e.requires_grad_(true);
    const Tensor start = at::arange(rays + 1, at::kLong) * 5;
    const auto once = [&] {
        const BlendOut out =
            blend(start, numbers({rays * 5}, 0.1, 0.2, at::kFloat, 3), numbers({rays * 5}, 0, 5, at::kFloat, 4),
                  numbers({rays * 5, 3}, 0, 1, at::kFloat, 5), edit, {});
        return std::pair{out.color.detach(), torch::autograd::grad({out.color.sum()}, {edit.density_e})[0]};
    };
    const int threads = at::get_num_threads();
    at::set_num_threads(1);
    const auto one = once();
    at::set_num_threads(2);
    const auto two = once();
    at::set_num_threads(threads);
    EXPECT_TRUE(at::equal(one.first, two.first));
    EXPECT_TRUE(at::equal(one.second, two.second));
}

TEST(BlendAutograd, WrongInputsAreNamed) {
    const auto message = [](auto change) -> std::string {
        Case c = make_case("add,remove,change", at::kFloat);
        change(c);
        try {
            run(c);
        } catch (const std::invalid_argument& error) {
            return error.what();
        }
        return "no error";
    };
    const auto has = [](const std::string& text, const char* part) { return text.find(part) != std::string::npos; };
    EXPECT_TRUE(has(message([](Case& c) { c.edit = {}; }), "no head"));
    EXPECT_TRUE(has(message([](Case& c) { c.edit.color_e = Tensor(); }), "color_e"));
    EXPECT_TRUE(has(message([](Case& c) { c.edit.density_e = at::ones({7}); }), "density_e"));
    EXPECT_TRUE(has(message([](Case& c) { c.color_o = c.color_o.to(at::kDouble); }), "color_o"));
    EXPECT_TRUE(has(message([](Case& c) { c.start = torch::tensor({0, 4, 3, 8}, at::kLong); }), "start"));
    EXPECT_TRUE(has(message([](Case& c) { c.start = torch::tensor({0, 3, 9}, at::kLong); }), "start"));
}

}  // namespace
}  // namespace fieldgraft
