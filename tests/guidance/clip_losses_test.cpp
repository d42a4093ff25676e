#include "core/guidance/clip_losses.h"

#include <gtest/gtest.h>

#include "tests/guidance/tiny_model.h"

namespace fieldgraft {
namespace {

Tensor numbers(std::initializer_list<double> values) {
    return at::tensor(at::ArrayRef<double>(values), torch::kDouble);
}

TEST(ClipLosses, ClosedForms) {
    EXPECT_NEAR(soft_norm(numbers({3, 4}), 12).item<double>(), 13, 1e-12);
    EXPECT_NEAR(soft_cosine(numbers({2, 0}), numbers({0, 5}), 1e-2).item<double>(), 0, 1e-12);
    EXPECT_NEAR(soft_cosine(numbers({1, 0}), numbers({1, 0}), 1).item<double>(), 0.5, 1e-12);
    EXPECT_NEAR(mean_text(at::stack({numbers({3, 0}), numbers({0, 7})})).square().sum().item<double>(), 1, 1e-12);

    // Same, orthogonal and opposite: 0, 1 and 2; lengths do not matter.
    const Tensor images = at::stack({numbers({2, 0}), numbers({0, 3}), numbers({-4, 0})});
    EXPECT_NEAR(global_loss(images.narrow(0, 0, 1), numbers({9, 0})).item<double>(), 0, 1e-12);
    EXPECT_NEAR(global_loss(images, numbers({9, 0})).item<double>(), 1, 1e-12);
    EXPECT_NEAR(global_loss(images.narrow(0, 2, 1), numbers({9, 0})).item<double>(), 2, 1e-12);

    // Moved from e1 to e2 as the texts did: a difference of length √2, softened by ε.
    const Tensor before = numbers({1, 0, 0}).unsqueeze(0), after = numbers({0, 5, 0}).unsqueeze(0);
    const double epsilon = 1e-2, expected = 1 - std::sqrt(2.0) / std::sqrt(2 + epsilon * epsilon);
    EXPECT_NEAR(directional_loss(before, after, numbers({3, 0, 0}), numbers({0, 2, 0})).item<double>(), expected,
                1e-12);
    EXPECT_NEAR(directional_loss(after, before, numbers({3, 0, 0}), numbers({0, 2, 0})).item<double>(), 2 - expected,
                1e-12);
}

TEST(ClipLosses, TheStartIsFiniteAndTame) {
    Random random(3);
    for (const auto type : {torch::kFloat, torch::kDouble}) {
        const Tensor before = normal(random, {4, 16}, 1, type);
        const Tensor source = normal(random, {16}, 1, type), target = normal(random, {16}, 1, type);
        for (const double move : {0.0, 1e-30, 1e-12, 1e-7, 1e-4, 1.0, 1e4}) {
            const Tensor after = (before + move * normal(random, {4, 16}, 1, type)).requires_grad_(true);
            const Tensor loss = directional_loss(before, after, source, target);
            const Tensor gradient = torch::autograd::grad({loss}, {after})[0];
            EXPECT_TRUE(at::isfinite(loss).item<bool>() && at::isfinite(gradient).all().item<bool>()) << move;
            // Four copies share the mean; embeddings are about 4 long.
            EXPECT_LT(gradient.norm().item<double>(), 1 / difference_epsilon) << move;
            if (move == 0) {
                EXPECT_NEAR(loss.item<double>(), 1, 1e-6);
                EXPECT_GT(gradient.norm().item<double>(), 1e-2) << "the first step must have somewhere to go";
            }
        }
    }
}

TEST(ClipLosses, GradientsMatchFiniteDifferences) {
    Random random(7);
    const Tensor before = normal(random, {3, 10}, 1, torch::kDouble),
                 after = normal(random, {3, 10}, 1, torch::kDouble);
    const Tensor source = normal(random, {10}, 1, torch::kDouble), target = normal(random, {10}, 1, torch::kDouble);
    EXPECT_LT(gradient_error([&](const Tensor& x) { return global_loss(x, target); }, after, random), 1e-7);
    EXPECT_LT(
        gradient_error([&](const Tensor& x) { return directional_loss(before, x, source, target); }, after, random),
        1e-7);
    EXPECT_LT(
        gradient_error([&](const Tensor& x) { return directional_loss(x, after, source, target); }, before, random),
        1e-7);
    // Close to the start the curvature is 1/ε²: a smaller step.
    const Tensor near = before + 1e-3 * after;
    EXPECT_LT(
        gradient_error([&](const Tensor& x) { return directional_loss(before, x, source, target); }, near, random),
        1e-5);
}

TEST(ClipLosses, BadInputIsRefused) {
    const Tensor images = at::rand({2, 4}), text = at::rand({4});
    EXPECT_NE(
        message_of<InputError>([&] { directional_loss(images, images, text, text * 3); }).find("the same to the model"),
        std::string::npos);
    EXPECT_THROW(global_loss(images, at::rand({5})), std::invalid_argument);
    EXPECT_THROW(directional_loss(images, at::rand({3, 4}), text, at::rand({4})), std::invalid_argument);
    EXPECT_THROW(soft_norm(images, 0), std::invalid_argument);
    EXPECT_TRUE(at::isfinite(to_unit(at::zeros({3}))).all().item<bool>());
}

}  // namespace
}  // namespace fieldgraft
