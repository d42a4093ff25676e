// Specifications: presets, validation with one-line messages, JSON both ways, and the plan compiled out of them.
#include "core/edit/edit_spec.h"

#include <gtest/gtest.h>

#include "core/base/errors.h"
#include "core/edit/edit_plan.h"

namespace fieldgraft {
namespace {

EditSpec valid_spec(const std::string& operations = "change", const std::string& preset = "builtin") {
    EditSpec spec = EditSpec::from_preset(preset, Operations::parse(operations));
    spec.source = "bulldozer";
    spec.target = "red bulldozer";
    return spec;
}

std::string complaint(const EditSpec& spec) {
    try {
        spec.validate(400, 300);
    } catch (const InputError& error) {
        return error.what();
    }
    return "";
}

TEST(EditSpec, PresetsFollowThePaper) {
    const EditSpec hash = valid_spec("add,change", "paper-hash");
    EXPECT_EQ(hash.patch, 128);
    EXPECT_EQ(hash.weight("dir"), 1.0);
    EXPECT_EQ(hash.weight("global"), 0.5);
    EXPECT_EQ(hash.weight("opacity"), 2.0);
    EXPECT_EQ(hash.weight("reg"), 1.0);
    EXPECT_EQ(hash.nominal_iterations, 2000);
    EXPECT_EQ(hash.dilations(), 10);
    EXPECT_FALSE(hash.tau.relative_to_region);
    EXPECT_EQ(valid_spec("change", "paper-mlp").nominal_iterations, 3000);
    EXPECT_EQ(valid_spec("add,change", "paper-mlp").nominal_iterations, 4000);
    EXPECT_EQ(valid_spec("add", "paper-mlp").nominal_iterations, 5000);
    EXPECT_EQ(valid_spec("change", "paper-mlp").reg_from, 1000);
    for (const std::string& name : EditSpec::known_presets())
        EXPECT_EQ(complaint(valid_spec("change", name)), "") << name;
    EXPECT_THROW(EditSpec::from_preset("best", Operations::parse("add")), InputError);
}

TEST(EditSpec, SaysWhatIsWrongInOneLine) {
    EditSpec spec = valid_spec();
    spec.source = "  ";
    EXPECT_NE(complaint(spec).find("--source"), std::string::npos);
    spec = valid_spec();
    spec.target = "Bulldozer";
    EXPECT_NE(complaint(spec).find("same as --source"), std::string::npos);
    spec = valid_spec();
    spec.operations = {};
    EXPECT_NE(complaint(spec).find("--ops"), std::string::npos);
    spec = valid_spec();
    spec.patch = 301;
    EXPECT_NE(complaint(spec).find("at most 300"), std::string::npos);
    spec = valid_spec();
    spec.tau.add = std::nan("");
    EXPECT_NE(complaint(spec).find("--tau-add"), std::string::npos);
    spec = valid_spec();
    spec.region_source = RegionSource::masks;
    EXPECT_NE(complaint(spec).find("--mask-only"), std::string::npos);
    spec = valid_spec();
    for (const char* name : {"dir", "global", "global_edit"}) spec.set_weight(name, 0);
    EXPECT_NE(complaint(spec).find("nothing follows the text"), std::string::npos);
    EXPECT_EQ(complaint(spec).find('\n'), std::string::npos);
}

TEST(EditSpec, UnknownWeightNamesTheKnownOnes) {
    EditSpec spec = valid_spec();
    try {
        spec.set_weight("colour", 1);
        FAIL() << "accepted";
    } catch (const InputError& error) {
        EXPECT_NE(std::string(error.what()).find("global_edit"), std::string::npos);
    }
    EXPECT_THROW(spec.set_weight("dir", -1), InputError);
    spec.set_weight("dir", 3);
    EXPECT_EQ(spec.weight("dir"), 3.0);
}

TEST(EditSpec, JsonRoundTrip) {
    EditSpec spec = valid_spec("add,remove");
    spec.masks.push_back({"r_3", "mask.png"});
    spec.region_source = RegionSource::both;
    spec.removed = RemovedMap::paper;
    spec.minutes = 2.5;
    spec.seed = 12345678901234ull;
    spec.set_weight("smooth", 0.7);
    const Json json = spec.to_json();
    EXPECT_EQ(EditSpec::from_json(json).to_json(), json);
    EXPECT_EQ(EditSpec::from_json(json).masks.at(0).view, "r_3");
}

TEST(EditSpec, JsonIsChecked) {
    const Json good = valid_spec().to_json();
    const auto refused = [&](const std::string& key, const Json& value) {
        Json bad = good;
        bad[key] = value;
        EXPECT_THROW(EditSpec::from_json(bad), InputError) << key;
    };
    refused("patches", 3);
    refused("patch", "many");
    refused("removed", "invisible");
    refused("operations", "paint");
    refused("weights", {{"colour", 1}});
    EXPECT_THROW(EditSpec::from_json(Json::array()), InputError);
}

TEST(EditSpec, PlacementFollowsTheWords) {
    EditSpec spec = valid_spec("add");
    EXPECT_EQ(spec.resolved_placement(), Placement::around);
    spec.target = "bulldozer with a red Hat";
    EXPECT_EQ(spec.resolved_placement(), Placement::above);
    spec.target = "overgrown bulldozer";
    EXPECT_EQ(spec.resolved_placement(), Placement::around);
    spec.placement = Placement::above;
    EXPECT_EQ(spec.resolved_placement(), Placement::above);
}

TEST(EditSpec, WhatIsAddedIsComparedWithItsOwnWords) {
    EditSpec spec = valid_spec("add");
    EXPECT_TRUE(spec.addition_alone);
    const auto added = [&](const std::string& target) {
        spec.target = target;
        return spec.edit_text();
    };
    EXPECT_EQ(added("bulldozer with a red ball on top"), "a red ball");
    EXPECT_EQ(added("Bulldozer with Snow on it"), "Snow");
    EXPECT_EQ(added("bulldozer with a hat"), "a hat");
    EXPECT_EQ(added("A bulldozer on fire with flames on top"), "flames");
    // Nothing is said of what is added by itself: nothing to compare.
    EXPECT_EQ(added("burning bulldozer"), "");
    EXPECT_FALSE(EditPlan::compile(spec).edit_image);
    EXPECT_EQ(added("bulldozer with on top"), "");
    // A "with" of the source's is not the addition's.
    spec.source = "bulldozer with wheels";
    EXPECT_EQ(added("bulldozer with wheels and a hat"), "");
    EXPECT_EQ(added("bulldozer with wheels with a hat"), "a hat");
    EXPECT_TRUE(EditPlan::compile(spec).edit_image);
    spec.addition_alone = false;
    EXPECT_EQ(added("bulldozer with a hat"), "bulldozer with a hat");
    EXPECT_GT(valid_spec("add").weight("global_edit"), 0);
    EXPECT_FALSE(valid_spec("add,change").addition_alone);
    EXPECT_FALSE(valid_spec("add", "paper-hash").addition_alone);
}

// A removal knows its region; the guide has less of a say than where it must say what to paint.
TEST(EditSpec, RemovalAloneAsksTheGuideLess) {
    const EditSpec alone = valid_spec("remove"), both = valid_spec("remove,change");
    EXPECT_LT(alone.weight("dir"), both.weight("dir"));
    // An inner pixel that is not removed yet must feel more pull than push: 2 (1 - 0) against the limit's weight.
    EXPECT_LT(alone.weight("opacity"), 2 * alone.weight("region") * alone.weight("inside"));
    EXPECT_EQ(valid_spec("remove", "paper-hash").weight("dir"), valid_spec("change", "paper-hash").weight("dir"));
}

TEST(EditPlan, HoldsWhatTheOperationsNeedAndNothingElse) {
    const EditPlan change = EditPlan::compile(valid_spec("change"));
    EXPECT_EQ(change.heads, (std::vector<std::string>{"color_e", "beta_color"}));
    EXPECT_EQ(change.maps, (std::vector<std::string>{"changed"}));
    EXPECT_FALSE(change.has("reg"));
    EXPECT_TRUE(change.geometry_fixed);
    EXPECT_FALSE(change.march_region);
    EXPECT_EQ(change.positive_weight_floor, 1.0);

    const EditPlan remove = EditPlan::compile(valid_spec("remove", "paper-hash"));
    EXPECT_EQ(remove.heads, (std::vector<std::string>{"beta_density"}));
    EXPECT_FALSE(remove.edit_image);
    EXPECT_FALSE(remove.has("global_edit"));

    const EditPlan add = EditPlan::compile(valid_spec("add", "paper-hash"));
    EXPECT_EQ(add.heads, (std::vector<std::string>{"density_e", "color_e"}));
    EXPECT_TRUE(add.march_region && add.edit_image && add.has("reg"));
    EXPECT_EQ(add.positive_weight_floor, 30.0);
    EXPECT_EQ(EditPlan::compile(valid_spec("add,remove,change")).maps.size(), 3u);
}

}  // namespace
}  // namespace fieldgraft
