#include "core/edit/plan_cost.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace fieldgraft {
namespace {

EditSpec spec_of(const std::string& operations) {
    EditSpec spec = EditSpec::from_preset("paper-hash", Operations::parse(operations));
    spec.source = "bulldozer";
    spec.target = "bulldozer with a red ball";
    return spec;
}

PlanCost cost(const std::string& operations) {
    EditFieldConfig config;
    config.operations = Operations::parse(operations);
    return cost_of(config, EditPlan::compile(spec_of(operations)));
}

bool says(const std::vector<LeftOut>& list, const std::string& part) {
    return std::any_of(list.begin(), list.end(),
                       [&](const LeftOut& l) { return l.what.find(part) != std::string::npos; });
}

TEST(PlanCost, CountsByHand) {
    // Levels of 9³, 17³ and 33³ entries of 4 numbers; 12→64 with bias, 64→1 with bias.
    const PlanCost remove = cost("remove");
    EXPECT_EQ(remove.parameters, 4 * (9 * 9 * 9 + 17 * 17 * 17 + 33 * 33 * 33) + 12 * 64 + 64 + 64 + 1);
    EXPECT_EQ(remove.state_bytes, 16 * remove.parameters);
    EXPECT_EQ(remove.drawing_operations, 2 * (8 * 12 + 12 * 64 + 64));
    EXPECT_EQ(remove.training_operations, 2 * (2 * 8 * 12 + 4 * 12 * 64 + 3 * 64));
}

TEST(PlanCost, WhatIsOffCostsNothing) {
    const PlanCost all = cost("add,remove,change");
    for (const std::string operations : {"add", "remove", "change", "add,remove", "add,change", "remove,change"}) {
        const PlanCost part = cost(operations);
        EXPECT_LT(part.parameters, all.parameters) << operations;
        EXPECT_LT(part.training_operations, all.training_operations) << operations;
        EXPECT_LT(part.training_bytes, all.training_bytes) << operations;
        EXPECT_LE(part.tower_passes, all.tower_passes) << operations;
    }
    EXPECT_EQ(all.tower_passes, 5);
    EXPECT_EQ(cost("change").tower_passes, 5);
    EXPECT_EQ(cost("remove").tower_passes, 3);
}

TEST(PlanCost, SaysWhatIsLeftOut) {
    const auto list = [](const std::string& operations) {
        const EditSpec spec = spec_of(operations);
        return left_out(spec, EditPlan::compile(spec));
    };
    EXPECT_TRUE(says(list("remove"), "colour of g, its picture"));
    EXPECT_FALSE(says(list("remove"), "beta of the density"));
    EXPECT_TRUE(says(list("change"), "densities and transmittances"));
    EXPECT_TRUE(says(list("change"), "density of g"));
    const auto all = list("add,remove,change");
    EXPECT_FALSE(says(all, "its map"));
    EXPECT_TRUE(says(all, "text tower"));
}

}  // namespace
}  // namespace fieldgraft
