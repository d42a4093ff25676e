// Localised losses against closed forms, and their gradients against finite differences in double.
#include "core/edit/losses.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace fieldgraft {
namespace {

Tensor doubles(std::vector<double> values, int rows, int columns) {
    return at::tensor(values, at::kDouble).reshape({rows, columns});
}

// Largest difference between autograd and central differences, relative to the larger of 1 and the gradient.
double slope_error(const std::function<Tensor(const Tensor&)>& f, const Tensor& at_point, double step = 1e-6) {
    Tensor x = at_point.clone().set_requires_grad(true);
    const Tensor gradient = torch::autograd::grad({f(x)}, {x})[0].reshape(-1);
    double worst = 0;
    for (std::int64_t i = 0; i < x.numel(); ++i) {
        Tensor up = at_point.clone(), down = at_point.clone();
        up.view(-1)[i] += step;
        down.view(-1)[i] -= step;
        const double slope = (f(up).item<double>() - f(down).item<double>()) / (2 * step);
        const double mine = gradient[i].item<double>();
        worst = std::max(worst, std::abs(slope - mine) / std::max(1.0, std::abs(slope)));
    }
    return worst;
}

TEST(RegionLoss, ClosedForm) {
    const Tensor map = doubles({0.5, 0.25, 1.0, 0.0}, 2, 2);
    const RegionMasks masks{at::tensor({1, 0, 0, 0}).to(at::kBool).reshape({2, 2}),
                            at::tensor({0, 1, 1, 0}).to(at::kBool).reshape({2, 2})};
    // (0.25² + 1²)/4 outside, (1 − 0.5)²/4 inside.
    EXPECT_NEAR(region_loss(map, masks, 1).item<double>(), (0.0625 + 1 + 0.25) / 4, 1e-15);
    EXPECT_NEAR(region_loss(map, masks, 30).item<double>(), (0.0625 + 1 + 30 * 0.25) / 4, 1e-15);
    EXPECT_LT(slope_error([&](const Tensor& x) { return region_loss(x, masks, 30); }, map), 1e-8);
}

TEST(RegionLoss, EmptyRegionOnlyPushesDown) {
    const Tensor none = at::zeros({3, 3}, at::kBool);
    const Tensor map = at::full({3, 3}, 0.5, at::kDouble).set_requires_grad(true);
    const Tensor loss = region_loss(map, {none, none.logical_not()}, positive_weight(0, 9, 30));
    EXPECT_NEAR(loss.item<double>(), 0.25, 1e-15);
    EXPECT_EQ(region_loss(map, {none, none}, 1).item<double>(), 0.0);
    EXPECT_GT(torch::autograd::grad({loss}, {map})[0].min().item<double>(), 0);
}

TEST(RegionLoss, PositiveWeightFollowsThePaper) {
    EXPECT_EQ(positive_weight(100, 5184, 1), 1.0);                        // no add
    EXPECT_EQ(positive_weight(5184, 5184, 30), 30.0);                     // large region: the floor
    EXPECT_NEAR(positive_weight(9, 5184, 30), (5184.0 - 9) / 10, 1e-12);  // small region: the ratio
    EXPECT_NEAR(positive_weight(0, 5184, 30), 5184.0, 1e-12);
    EXPECT_THROW(positive_weight(10, 5, 1), std::invalid_argument);
}

TEST(RegionLoss, RefusesWrongShapes) {
    const Tensor map = at::zeros({4, 4}), mask = at::zeros({4, 3}, at::kBool);
    EXPECT_THROW(region_loss(map, {mask, mask}, 1), std::invalid_argument);
    EXPECT_THROW(region_loss(map, {map, map}, 1), std::invalid_argument);
}

TEST(OpacityLoss, FlatBelowTheThreshold) {
    const Tensor low = at::full({4, 4}, 0.1, at::kDouble).set_requires_grad(true);
    const Tensor loss = opacity_loss(low, 0.2);
    EXPECT_EQ(loss.item<double>(), 0.2);
    EXPECT_EQ(torch::autograd::grad({loss}, {low})[0].abs().max().item<double>(), 0.0);
    const Tensor high = doubles({0.9, 0.4, 0.3, 0.8}, 2, 2);
    EXPECT_NEAR(opacity_loss(high, 0.2).item<double>(), 0.6, 1e-15);
    EXPECT_LT(slope_error([](const Tensor& x) { return opacity_loss(x, 0.2); }, high), 1e-8);
}

TEST(OpacityLoss, AnnealingIsLinearThenConstant) {
    EXPECT_EQ(annealed(0.8, 0.35, 0, 100), 0.8);
    EXPECT_NEAR(annealed(0.8, 0.35, 50, 100), 0.575, 1e-15);
    EXPECT_EQ(annealed(0.8, 0.35, 100, 100), 0.35);
    EXPECT_EQ(annealed(0.8, 0.35, 5000, 100), 0.35);
    EXPECT_EQ(annealed(0.8, 0.35, 0, 0), 0.35);
}

TEST(Entropy, ClosedFormAndSymmetry) {
    const Tensor z = doubles({0.5, 0.25, 0.75, 0.0, 1.0, 1e-12}, 2, 3);
    const Tensor h = binary_entropy(z).reshape(-1);
    EXPECT_NEAR(h[0].item<double>(), 1.0, 1e-15);
    EXPECT_NEAR(h[1].item<double>(), 2 - 0.75 * std::log2(3.0), 1e-14);
    EXPECT_NEAR(h[2].item<double>(), h[1].item<double>(), 1e-15);
    EXPECT_EQ(h[3].item<double>(), 0.0);
    EXPECT_EQ(h[4].item<double>(), 0.0);
    EXPECT_NEAR(h[5].item<double>(), 1e-12 * (-std::log2(1e-12) + 1 / std::log(2.0)), 1e-20);
}

TEST(Entropy, GradientAgainstFiniteDifferences) {
    const Tensor z = doubles({0.02, 0.3, 0.5, 0.7, 0.9, 0.99}, 2, 3);
    EXPECT_LT(slope_error([](const Tensor& x) { return entropy_loss(x); }, z), 1e-7);
}

TEST(Entropy, HardInputsStayFiniteInFloat) {
    const float inf = std::numeric_limits<float>::infinity();
    for (const float value :
         {0.0f, 1.0f, 1.0f + 1e-7f, -1e-7f, 1e-38f, std::nextafter(1.0f, 0.0f), std::nextafter(0.0f, -inf)}) {
        const Tensor z = at::full({1, 1}, value).set_requires_grad(true);
        const Tensor loss = entropy_loss(z);
        EXPECT_TRUE(std::isfinite(loss.item<float>())) << value;
        EXPECT_GE(loss.item<float>(), 0.0f) << value;
        const float slope = torch::autograd::grad({loss}, {z})[0].item<float>();
        EXPECT_TRUE(std::isfinite(slope) && std::abs(slope) <= 20.01f) << value << " has slope " << slope;
    }
}

}  // namespace
}  // namespace fieldgraft
