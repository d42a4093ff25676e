#include "core/field/kernel_edit.h"

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace fieldgraft {
namespace {

constexpr std::int64_t count = 3000;  // more than two chunks of acting samples

EditField lively_edit(const std::string& operations) {
    EditFieldConfig config;
    config.operations = Operations::parse(operations);
    config.resolutions = {4, 8};
    config.hidden = 16;
    config.initial_beta = 0.4;
    EditField edit(config, {}, 5);
    Tensor support = at::zeros({8, 8, 8}, at::kByte);
    support.slice(2, 3, 8).fill_(1);  // x above a fourth of the way down from the middle
    edit.set_support(support);
    edit.set_level_weights({1, 0.25f});
    return edit;
}

// Positions in the box ±1.5, and the same in the unit cube, one axis after the other.
struct Points {
    Tensor positions = at::empty({count, 3});
    std::vector<float> unit = std::vector<float>(3 * count);
    Points() {
        Random random(3);
        for (std::int64_t i = 0; i < count; ++i) {
            for (int c = 0; c < 3; ++c) {
                const float u = random.uniform();
                unit[c * count + i] = u;
                positions[i][c] = 3 * u - 1.5f;
            }
        }
    }
};

class KernelEditOf : public ::testing::TestWithParam<const char*> {};

TEST_P(KernelEditOf, GivesWhatTheFieldDoesTimesItsStrengths) {
    at::NoGradGuard no_grad;
    const EditField edit = lively_edit(GetParam());
    const Points points;
    const EditSamples expected = edit.evaluate(points.positions);
    const KernelEdit::Strengths strengths{0.5f, 0.75f, 0.25f};
    constexpr std::size_t stride = KernelEdit::row + 2;
    std::vector<float> rows(count * stride, 0.0f);
    KernelEdit(edit, strengths).evaluate(points.unit.data(), count, rows.data(), stride);
    const auto check = [&](const Tensor& head, std::size_t place, std::int64_t size, float strength) {
        for (std::int64_t i = 0; i < count; ++i) {
            for (std::int64_t k = 0; k < size; ++k) {
                const float got = rows[i * stride + place + k];
                const float wanted = head.defined() ? strength * head.data_ptr<float>()[size * i + k] : 0;
                ASSERT_NEAR(got, wanted, 1e-5 + 1e-5 * std::abs(wanted)) << place << " of sample " << i;
            }
        }
    };
    check(expected.density_e, KernelEdit::density_e, 1, strengths.add);
    check(expected.color_e, KernelEdit::color_e, 3, 1);
    check(expected.beta_density, KernelEdit::beta_density, 1, strengths.remove);
    check(expected.beta_color, KernelEdit::beta_color, 1, strengths.change);
}

INSTANTIATE_TEST_SUITE_P(Operations, KernelEditOf,
                         ::testing::Values("add", "remove", "change", "add,remove", "add,change", "remove,change",
                                           "add,remove,change"));

TEST(KernelEdit, WhatHasNoStrengthIsNotThere) {
    at::NoGradGuard no_grad;
    const EditField edit = lively_edit("add,remove,change");
    const Points points;
    std::vector<float> rows(count * KernelEdit::row, 0.0f);
    KernelEdit(edit, {0, 1, 0}).evaluate(points.unit.data(), count, rows.data(), KernelEdit::row);
    for (std::int64_t i = 0; i < count; ++i) {
        for (const std::size_t place : {0, 1, 2, 3, 5}) ASSERT_EQ(rows[i * KernelEdit::row + place], 0);
    }
}

TEST(UnitCells, AreTheBoxesCells) {
    FieldGeometry geometry;
    geometry.box_min = {-1, -1, -1};
    geometry.box_max = {3, 1, 0};  // the longest edge is x: y ends at a half, z at a quarter
    Tensor grid = at::zeros({2, 2, 2}, at::kByte);
    grid[1][0][1] = 1;  // upper z, lower y, upper x
    const UnitCells cells(geometry, grid);
    EXPECT_TRUE(cells.holds(0.6f, 0.2f, 0.2f));
    EXPECT_FALSE(cells.holds(0.4f, 0.2f, 0.2f));
    EXPECT_FALSE(cells.holds(0.6f, 0.3f, 0.2f));
    EXPECT_FALSE(cells.holds(0.6f, 0.2f, 0.1f));
    EXPECT_TRUE(cells.holds(1.00001f, 0.2f, 0.2501f)) << "the box's edge, give or take rounding";
    EXPECT_TRUE(UnitCells(geometry, {}).holds(0.1f, 0.1f, 0.1f));
}

}  // namespace
}  // namespace fieldgraft
