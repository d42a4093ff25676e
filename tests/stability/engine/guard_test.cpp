// What happens when steps go wrong: left out, rolled back, given up; and that healthy runs do not notice.
#include "core/train/step_guard.h"

#include <gtest/gtest.h>

#include "core/base/errors.h"
#include "core/base/safetensors.h"
#include "tests/base/one_thread.h"
#include "tests/base/temp_folder.h"
#include "tests/edit/edit_fixtures.h"
#include "tests/train/ball_scene.h"

namespace fieldgraft::stability {
namespace {

namespace fs = std::filesystem;
using Outcome = StepGuard::Outcome;

// A run that has learnt one number.
struct Counter {
    Tensor learnt = at::zeros({1});
    GuardState state;
    StepGuard guard;
    std::int64_t iteration = 0;

    explicit Counter(GuardLimits limits = {})
        : guard(state,
                {[this] {
                     return StepGuard::Tensors{{"x", learnt}};
                 },
                 [this](const StepGuard::Tensors& good) { learnt.copy_(good.at("x")); }},
                limits) {
        guard.keep(0);
    }
    // A step that counts and has that loss; NaN: one that is left out.
    Outcome step(double loss) {
        const bool good = std::isfinite(loss);
        if (good) learnt.add_(1);
        return guard.after_step(good, loss, iteration++);
    }
    float value() const { return learnt.item<float>(); }
};

TEST(StepGuard, HealthyStepsAreNotTouched) {
    Counter run;
    for (int i = 0; i < 2000; ++i) ASSERT_EQ(run.step(1.0 / (1 + i)), Outcome::taken);
    EXPECT_EQ(run.value(), 2000);
    EXPECT_EQ(run.state.scale, 1);
    EXPECT_EQ(run.state.skipped + run.state.roll_backs, 0);
    EXPECT_FALSE(run.guard.settle());
}

TEST(StepGuard, AFewBadStepsAreLeftOutAndTheRateRecovers) {
    Counter run;
    for (int i = 0; i < 300; ++i) run.step(1);
    for (int i = 0; i < 7; ++i) EXPECT_EQ(run.step(NAN), Outcome::skipped);
    EXPECT_EQ(run.state.scale, 1.0 / 128);
    for (int i = 0; i < 500; ++i) EXPECT_EQ(run.step(1), Outcome::taken);
    EXPECT_EQ(run.state.scale, 1);
    EXPECT_EQ(run.state.skipped, 7);
    EXPECT_EQ(run.value(), 800);
}

TEST(StepGuard, RepeatedOnesRollBackAndTheRateStaysHalved) {
    Counter run({.interval = 100});
    for (int i = 0; i < 350; ++i) run.step(1);
    for (int i = 0; i < 7; ++i) EXPECT_EQ(run.step(NAN), Outcome::skipped);
    EXPECT_EQ(run.step(NAN), Outcome::rolled_back);
    EXPECT_EQ(run.value(), 300);
    EXPECT_NE(run.guard.reason().find("after 300 iterations, with 1/2 of the learning rate"), std::string::npos)
        << run.guard.reason();
    for (int i = 0; i < 500; ++i) run.step(1);
    EXPECT_EQ(run.state.scale, 0.5);
    EXPECT_EQ(run.state.roll_backs, 1);
}

TEST(StepGuard, ALossThatBlowsUpWithoutANaNRollsBack) {
    Counter run({.interval = 64});
    for (int i = 0; i < 200; ++i) ASSERT_EQ(run.step(0.01), Outcome::taken);
    int bad = 0;
    while (run.step(0.5) == Outcome::taken && ++bad < 100) {
    }
    EXPECT_LT(bad, 10);
    EXPECT_EQ(run.state.roll_backs, 1);
    EXPECT_EQ(run.value(), 192);
}

TEST(StepGuard, DeadNetworksRollBackUnlessNothingIsLeftToLearn) {
    for (const double loss : {0.1, 1e-6}) {
        Counter run({.interval = 64});
        for (int i = 0; i < 64; ++i) run.step(loss);
        int idle = 0;
        while (run.guard.after_step(true, loss, run.iteration++, true) == Outcome::taken && ++idle < 500)
            run.learnt.add_(1);
        if (loss > 0.01) {
            EXPECT_LT(idle, 20);
            EXPECT_EQ(run.value(), 64);
        } else {
            EXPECT_EQ(idle, 500);
        }
    }
}

TEST(StepGuard, GivesUpAtTheLastGoodState) {
    Counter run({.roll_backs = 3, .interval = 64});
    for (int i = 0; i < 130; ++i) run.step(1);
    int roll_backs = 0;
    Outcome outcome = Outcome::taken;
    for (int i = 0; i < 1000 && outcome != Outcome::given_up; ++i) {
        outcome = run.step(NAN);
        if (outcome == Outcome::rolled_back) ++roll_backs;
    }
    EXPECT_EQ(outcome, Outcome::given_up);
    EXPECT_EQ(roll_backs, 3);
    EXPECT_EQ(run.value(), 128);
}

TEST(StepGuard, ABadStateIsNeverKept) {
    Counter run({.interval = 64});
    for (int i = 0; i < 100; ++i) run.step(1);
    run.learnt.fill_(NAN);
    for (int i = 0; i < 100; ++i) run.step(1);
    for (int i = 0; i < 8; ++i) run.step(NAN);
    EXPECT_EQ(run.value(), 64);
}

TEST(StepGuard, SettlesWhereItWasBetter) {
    Counter run({.interval = 64, .collapse = 10, .worse = 100});
    for (int i = 0; i < 128; ++i) run.step(1);
    for (int i = 0; i < 60; ++i) ASSERT_EQ(run.step(4), Outcome::taken);
    EXPECT_FALSE(run.guard.settle()) << "four times the lowest is no disaster";
    for (int i = 0; i < 60; ++i) ASSERT_EQ(run.step(8), Outcome::taken);
    EXPECT_EQ(run.value(), 248);
    EXPECT_TRUE(run.guard.settle());
    EXPECT_EQ(run.value(), 128);
}

TEST(StepGuard, StateKeepsItsBits) {
    GuardState state;
    state.level = 0.1;
    state.first = 1.0 / 3;
    state.skipped = 3;
    state.scale = 0.7;
    const GuardState again = GuardState::from_json(Json::parse(state.to_json().dump()));
    EXPECT_EQ(again.to_json(), state.to_json());
    EXPECT_EQ(again.first, state.first);
    EXPECT_THROW(GuardState::from_json(Json::object()), Json::exception);
}

using Guarded = OneThread;

struct Events {
    std::vector<Json> all;
    Reporter reporter{[this](const Json& event) { all.push_back(event); }};

    int warnings() const {
        return static_cast<int>(
            std::count_if(all.begin(), all.end(), [](const Json& e) { return e["event"] == "warning"; }));
    }
};

void expect_finite(const fs::path& file) {
    ASSERT_TRUE(fs::exists(file));
    EXPECT_EQ(not_finite(load_safetensors(file).tensors), "");
}

// A background that is no number makes every loss one.
TEST_F(Guarded, TrainingWithoutAGoodStepStopsWithItsLastGoodState) {
    TemporaryFolder folder;
    const fs::path checkpoint = folder.path() / "checkpoint.safetensors";
    TrainingData data = testing::ball_data();
    data.background = std::array<float, 3>{NAN, NAN, NAN};
    Events events;
    try {
        train_field(data, testing::small_options(400), events.reporter, checkpoint);
        FAIL() << "it went unnoticed";
    } catch (const Failure& error) {
        const std::string line = error.what();
        EXPECT_NE(line.find("8 roll-backs did not help"), std::string::npos) << line;
        EXPECT_NE(line.find("8 steps in a row"), std::string::npos) << line;
        EXPECT_NE(line.find(checkpoint.string()), std::string::npos) << line;
        EXPECT_EQ(line.find('\n'), std::string::npos);
    }
    EXPECT_EQ(events.warnings(), 8);
    expect_finite(checkpoint);
    // The state it left is that of a start: a run with a sane background goes on from it.
    EXPECT_NO_THROW(train_field(testing::ball_data(), testing::small_options(400), {}, checkpoint, true));
}

// Progress and figures say how often steps were left out.
TEST_F(Guarded, StepsLeftOutAreShown) {
    TrainingData data = testing::ball_data();
    Events events;
    const TrainResult result = train_field(data, testing::small_options(20), events.reporter);
    EXPECT_EQ(result.report.to_json().at("skipped"), 0);
    EXPECT_EQ(result.report.to_json().at("roll_backs"), 0);
    EXPECT_EQ(events.all.back().at("skipped"), 0);
    EXPECT_EQ(events.all.back().at("roll_backs"), 0);
}

TEST_F(Guarded, AnEditWithoutAGoodStepStopsWithItsLastGoodState) {
    SmallWorld world;
    EditSpec spec = small_spec("change", world.folder.path());
    spec.iterations = 300;
    spec.set_weight("dir", 1e300);  // infinite as a float
    EditRunOptions options;
    options.checkpoint = world.folder.path() / "bad.checkpoint.safetensors";
    Events events;
    EXPECT_THROW(train_edit(world.inputs, spec, options, events.reporter), Failure);
    EXPECT_EQ(events.warnings(), 8);
    expect_finite(options.checkpoint);
}

// The smallest scene and field that still show a ball.
TrainOptions tiny_options(std::int64_t iterations, double rate) {
    TrainOptions options = testing::small_options(iterations);
    options.samples = 256;
    options.step = 0.12;
    options.occupancy_resolution = 12;
    options.rate = rate;
    options.rate_end = 1;  // hostile to the end
    HashFieldConfig& field = *options.field;
    field.levels = 3;
    field.log2_table_size = 9;
    field.finest_resolution = 16;
    field.density_hidden = field.color_hidden = 8;
    return options;
}

// At the highest rate there is, to the end: it recovers (the field is far better than an untrained one) or stops with
// the last good state saved. Nothing that is not finite is written either way.
TEST_F(Guarded, TwentyThousandIterationsUnderAHostileRateRecoverOrStop) {
    TemporaryFolder folder;
    const fs::path checkpoint = folder.path() / "checkpoint.safetensors", file = folder.path() / "field.safetensors";
    const double untrained = train_field(testing::ball_data(), tiny_options(1, 0.02)).report.psnr;
    for (const int width : {8, 32}) {
        TrainOptions options = tiny_options(20000, 1.0);
        options.field->density_hidden = options.field->color_hidden = width;
        fs::remove(checkpoint);
        try {
            const TrainResult result = train_field(testing::ball_data(), options, {}, checkpoint);
            EXPECT_EQ(result.report.iterations, 20000);
            EXPECT_GT(result.report.psnr, untrained + 3) << "neither recovered nor stopped, " << width << " wide";
            result.field->save(file);
            expect_finite(file);
        } catch (const Failure& error) {
            EXPECT_NE(std::string(error.what()).find(checkpoint.string()), std::string::npos) << error.what();
        }
        expect_finite(checkpoint);
    }
}

TEST_F(Guarded, AnEditUnderAHostileRateRecoversOrStops) {
    SmallWorld world;
    EditSpec spec = small_spec("add,remove,change", world.folder.path());
    spec.iterations = 150;
    spec.learning_rate = spec.learning_rate_end = 1e3;
    EditRunOptions options;
    options.checkpoint = world.folder.path() / "hostile.checkpoint.safetensors";
    const fs::path file = world.folder.path() / "hostile.safetensors";
    try {
        const EditResult result = train_edit(world.inputs, spec, options, Reporter());
        EXPECT_TRUE(std::isfinite(result.report.loss));
        result.edit.save(file);
        expect_finite(file);
    } catch (const Failure&) {
        expect_finite(options.checkpoint);
    }
}

}  // namespace
}  // namespace fieldgraft::stability
