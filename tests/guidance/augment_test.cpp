#include "core/guidance/augment.h"

#include <gtest/gtest.h>

#include "tests/guidance/tiny_model.h"

namespace fieldgraft {
namespace {

const Tensor white = at::ones({3});

// A neutral entry in second place goes through the arithmetic; the first one only marks it.
std::vector<Augmentation> second(const Augmentation& a) {
    return {Augmentation{}, a};
}

double largest_difference(const Tensor& a, const Tensor& b) {
    return (a - b).abs().max().item<double>();
}

TEST(Augment, NeutralParametersChangeNothing) {
    Random random(1);
    for (const int size : {1, 2, 7, 16}) {
        const Tensor image = uniform_image(random, {1, 3, size, size});
        const Tensor out = augment(image, std::vector<Augmentation>(3), white);
        ASSERT_EQ(out.sizes(), at::IntArrayRef({3, 3, size, size}));
        EXPECT_TRUE(at::equal(out.narrow(0, 0, 1), image)) << "the first copy is the picture bit for bit";
        EXPECT_LT(largest_difference(out, image.expand_as(out)), 1e-6);
    }
}

TEST(Augment, ColourHasItsClosedForm) {
    Random random(2);
    const Tensor image = uniform_image(random, {1, 3, 5, 5}, torch::kDouble);
    Augmentation a;
    a.brightness = 0.3;
    EXPECT_LT(largest_difference(augment(image, second(a), white)[1], image[0] + 0.3), 1e-12);
    a = {};
    a.saturation = 0;
    EXPECT_LT(largest_difference(augment(image, second(a), white)[1], image[0].mean(0, true).expand({3, 5, 5})), 1e-12);
    a = {};
    a.contrast = 0.25;
    const Tensor mean = image.mean();
    EXPECT_LT(largest_difference(augment(image, second(a), white)[1], (image[0] - mean) * 0.25 + mean), 1e-12);
}

TEST(Augment, ShiftMovesWholePixelsAndFills) {
    Random random(3);
    const Tensor image = uniform_image(random, {1, 3, 8, 8}, torch::kDouble);
    const Tensor fill = at::tensor({0.1, 0.2, 0.3}, torch::kDouble);
    Augmentation a;
    a.shift = {0.25, -0.125};  // two pixels to the right, one up
    const Tensor out = augment(image, second(a), fill)[1];
    EXPECT_LT(largest_difference(out.slice(1, 0, 7).slice(2, 2, 8), image[0].slice(1, 1, 8).slice(2, 0, 6)), 1e-12);
    EXPECT_LT(largest_difference(out.slice(2, 0, 2), fill.view({3, 1, 1}).expand({3, 8, 2})), 1e-12);
    EXPECT_LT(largest_difference(out.slice(1, 7, 8), fill.view({3, 1, 1}).expand({3, 1, 8})), 1e-12);
    a.shift = {1, 1};  // all of it out of the frame
    EXPECT_LT(largest_difference(augment(image, second(a), fill)[1], fill.view({3, 1, 1}).expand({3, 8, 8})), 1e-12);
}

TEST(Augment, CutoutIsASquareOfTheFill) {
    const Tensor image = at::zeros({1, 3, 8, 8});
    Augmentation a;
    a.cutout = 0.5;
    a.cutout_at = {0.5, 0.25};
    const Tensor out = augment(image, second(a), white)[1];
    EXPECT_EQ(out.sum().item<float>(), 3 * 4 * 4);
    EXPECT_EQ(out.slice(1, 0, 4).slice(2, 2, 6).sum().item<float>(), 3 * 4 * 4);
    a.cutout_at = {0, 0};  // cut at the frame
    EXPECT_EQ(augment(image, second(a), white)[1].sum().item<float>(), 3 * 2 * 2);
}

TEST(Augment, HomographyTakesMovedCornersBack) {
    const std::array<std::array<double, 2>, 4> corners{{{0.1, 0.05}, {0.8, 0.2}, {0.95, 0.9}, {0.15, 0.85}}};
    const std::array<std::array<double, 2>, 4> square{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
    const auto h = corner_homography(corners);
    for (int k = 0; k < 4; ++k) {
        const double w = h[6] * corners[k][0] + h[7] * corners[k][1] + h[8];
        EXPECT_NEAR((h[0] * corners[k][0] + h[1] * corners[k][1] + h[2]) / w, square[k][0], 1e-12);
        EXPECT_NEAR((h[3] * corners[k][0] + h[4] * corners[k][1] + h[5]) / w, square[k][1], 1e-12);
    }
    EXPECT_THROW(corner_homography({{{0, 0}, {0.5, 0.5}, {1, 1}, {0, 1}}}), std::invalid_argument);
}

TEST(Augment, PerspectiveShrinksTowardsTheMiddle) {
    // Corners moved in by a quarter on all sides: the picture at half size in the middle, the fill around it.
    Augmentation a;
    a.corners = {{{0.25, 0.25}, {0.75, 0.25}, {0.75, 0.75}, {0.25, 0.75}}};
    const Tensor ramp = ((at::arange(16, torch::kDouble) + 0.5) / 16).view({1, 1, 1, 16}).expand({1, 3, 16, 16});
    const Tensor out = augment(ramp, second(a), white)[1];
    const Tensor inside = ((at::arange(6, torch::kDouble) + 5.5) / 16 - 0.25) * 2;  // a bilinear ramp is exact inside
    EXPECT_LT(largest_difference(out[0][8].slice(0, 5, 11), inside), 1e-12);
    EXPECT_LT(largest_difference(out[0][1], at::ones({16}, torch::kDouble)), 1e-12);
}

TEST(Augment, TheSameParametersMakeTheSameViewsOfOtherPictures) {
    Random random(5);
    const auto augmentations = draw_augmentations({.copies = 6}, random);
    const Tensor image = uniform_image(random, {1, 3, 12, 12});
    EXPECT_TRUE(at::equal(augment(image, augmentations, white), augment(image, augmentations, white)));
    // Any square size takes them, the smallest too.
    for (const int size : {1, 2, 13, 72}) {
        const Tensor out = augment(uniform_image(random, {1, 3, size, size}), augmentations, white);
        EXPECT_EQ(out.size(0), 6);
        EXPECT_TRUE(at::isfinite(out).all().item<bool>());
    }
}

TEST(Augment, DrawsAreRepeatableAndInRange) {
    Random first(9), again(9);
    const AugmentSettings settings{.copies = 400, .colour = {0.15, 0.3, 0.3}};
    const auto a = draw_augmentations(settings, first), b = draw_augmentations(settings, again);
    EXPECT_EQ(a, b);
    EXPECT_EQ(a[0], Augmentation{});
    int warped = 0;
    for (std::size_t n = 1; n < a.size(); ++n) {
        EXPECT_LE(std::abs(a[n].brightness), 0.15 + 1e-6);
        EXPECT_LE(std::abs(a[n].contrast - 1), 0.3 + 1e-6);
        EXPECT_LE(std::abs(a[n].shift[0]), 0.125 + 1e-6);
        for (int k = 0; k < 4; ++k) EXPECT_LE(std::abs(a[n].corners[k][0] - (k == 1 || k == 2)), 0.2 + 1e-6);
        warped += a[n].warps();
    }
    EXPECT_NEAR(warped, 200, 50);  // five standard deviations
    EXPECT_THROW(draw_augmentations({.copies = 0}, first), std::invalid_argument);
    EXPECT_THROW(draw_augmentations({.cutout = 1.5}, first), std::invalid_argument);
    EXPECT_THROW(draw_augmentations({.perspective = std::nan("")}, first), std::invalid_argument);
}

TEST(Augment, GradientMatchesFiniteDifferences) {
    Random random(11);
    const auto augmentations = draw_augmentations({.copies = 8, .perspective_chance = 1}, random);
    const Tensor image = uniform_image(random, {1, 3, 9, 9}, torch::kDouble);
    const Tensor weight = normal(random, {8, 3, 9, 9}, 1, torch::kDouble);
    const auto f = [&](const Tensor& x) { return (augment(x, augmentations, white).square() * weight).sum(); };
    EXPECT_LT(gradient_error(f, image, random), 1e-6);
}

TEST(Augment, BadShapesAreNamed) {
    Random random(1);
    const auto augmentations = draw_augmentations({.copies = 2}, random);
    EXPECT_NE(message_of<std::invalid_argument>([&] {
                  augment(at::zeros({2, 3, 4, 4}), augmentations, white);
              }).find("[2, 3, 4, 4]"),
              std::string::npos);
    EXPECT_THROW(augment(at::zeros({1, 3, 4, 4}, torch::kInt), augmentations, white), std::invalid_argument);
    EXPECT_THROW(augment(at::zeros({1, 3, 4, 4}), augmentations, at::ones({4})), std::invalid_argument);
    EXPECT_THROW(augment(at::zeros({1, 3, 4, 4}), {}, white), std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
