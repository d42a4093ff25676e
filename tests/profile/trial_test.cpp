#include "core/profile/trial.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>

#include "core/base/errors.h"
#include "core/base/files.h"
#include "core/profile/chart.h"
#include "core/profile/report.h"

namespace fieldgraft {
namespace {

std::filesystem::path scratch(const std::string& name) {
    const auto folder = std::filesystem::temp_directory_path() / fmt::format("fieldgraft_profile_{}", getpid()) / name;
    std::filesystem::remove_all(folder);
    std::filesystem::create_directories(folder);
    return folder;
}

Point point(const std::string& knob, const std::string& value, double seconds, double psnr) {
    return {"rendering", knob, value, false, {seconds}, {{"seconds", seconds}, {"psnr", psnr}}};
}

const Measure psnr{"psnr", "PSNR", "dB"};

Trial counted(const std::string& value, int repeats, int& runs) {
    return {"rendering", "step", value, false, repeats, [&runs](const Reporter&) -> Json {
                ++runs;
                return {{"seconds", runs}, {"psnr", 30 + runs}};
            }};
}

TEST(ParetoFront, HoldsWhatNothingBeats) {
    const std::vector<Point> points{point("a", "slow and bad", 4, 20), point("a", "fast", 1, 25),
                                    point("a", "good", 3, 40), point("b", "as fast and worse", 1, 24),
                                    point("b", "as good, slower", 5, 40)};
    EXPECT_EQ(pareto_front(points, psnr), (std::vector<std::size_t>{1, 2}));
}

TEST(ParetoFront, LessMayBeBetter) {
    Measure bytes = psnr;
    bytes.more_is_better = false;
    const std::vector<Point> points{point("a", "x", 1, 25), point("a", "y", 2, 20), point("a", "z", 3, 22)};
    EXPECT_EQ(pareto_front(points, bytes), (std::vector<std::size_t>{0, 1}));
}

TEST(ParetoFront, LeavesOutWhatHasNoFigure) {
    Point none = point("a", "none", 1, 0);
    none.figures.erase("psnr");
    const std::vector<Point> points{none, point("a", "nan", 1, std::nan("")), point("a", "x", 2, 30)};
    EXPECT_EQ(pareto_front(points, psnr), (std::vector<std::size_t>{2}));
    EXPECT_TRUE(pareto_front({}, psnr).empty());
}

TEST(RunTrials, TakesTheMedianOfItsRepeats) {
    int runs = 0;
    const auto points = run_trials({counted("1", 3, runs), counted("2", 2, runs)}, {}, scratch("median"), false, {});
    ASSERT_EQ(points.size(), 2u);
    EXPECT_EQ(points[0].seconds, (std::vector<double>{1, 2, 3}));
    EXPECT_EQ(points[0].median_seconds(), 2);
    EXPECT_EQ(points[1].median_seconds(), 4.5);
    EXPECT_EQ(points[1].figures.at("psnr"), 35);
}

TEST(RunTrials, GoesOnWhereItWasStopped) {
    const auto folder = scratch("resume");
    const Json about{{"name", "lego"}};
    int runs = 0;
    std::atomic<bool> stop{false};
    Trial stopping = counted("2", 1, runs);
    stopping.run = [&](const Reporter& reporter) -> Json {
        stop = true;  // as Ctrl-C does while a trial runs
        if (reporter.stop_requested()) throw Cancelled();
        return {};
    };
    const Reporter reporter([](const Json&) {}, &stop);
    EXPECT_THROW(run_trials({counted("1", 1, runs), stopping, counted("3", 1, runs)}, about, folder, false, reporter),
                 Cancelled);
    EXPECT_EQ(runs, 1);
    // Not without being told to, and not with another field's.
    const std::vector<Trial> all{counted("0", 1, runs), counted("1", 1, runs), counted("2", 1, runs)};
    EXPECT_THROW(run_trials(all, about, folder, false, {}), InputError);
    EXPECT_THROW(run_trials(all, {{"name", "drums"}}, folder, true, {}), InputError);
    const auto points = run_trials(all, about, folder, true, {});
    EXPECT_EQ(runs, 3);
    ASSERT_EQ(points.size(), 3u);
    EXPECT_EQ(points[1].value, "1");
    EXPECT_EQ(points[1].seconds, std::vector<double>{1});
}

// A run that is stopped twice keeps what the first of them had measured further on.
TEST(RunTrials, LosesNothingThatWasSaved) {
    const auto folder = scratch("keep");
    int runs = 0;
    run_trials({counted("last", 1, runs)}, {}, folder, false, {});
    Trial failing = counted("second", 1, runs);
    failing.run = [](const Reporter&) -> Json { failure("no"); };
    EXPECT_THROW(run_trials({counted("first", 1, runs), failing, counted("last", 1, runs)}, {}, folder, true, {}),
                 Failure);
    run_trials({counted("first", 1, runs), counted("last", 1, runs)}, {}, folder, true, {});
    EXPECT_EQ(runs, 2);
}

TEST(Report, TableHasEveryFigure) {
    Point baked{"baking", "voxels, an edge", "256 \"usual\"", true, {1, 3, 2}, {{"psnr", 31.5}, {"mib", 12}}};
    const std::string csv = csv_of({point("step", "1/512", 0.5, 44), baked});
    EXPECT_EQ(csv,
              "sweep,knob,value,usual,seconds,least_seconds,most_seconds,mib,psnr\n"
              "rendering,step,1/512,0,0.5,0.5,0.5,,44\n"
              "baking,\"voxels, an edge\",\"256 \"\"usual\"\"\",1,2,1,3,12,31.5\n");
}

TEST(Report, LeavesTablesAndCharts) {
    const auto folder = scratch("report");
    const auto files =
        write_report({point("step", "1/512", 0.5, 44), point("step", "1/1024", 1, 54)}, {{"name", "lego"}}, folder);
    EXPECT_EQ(files.size(), 4u);
    for (const auto& file : files) EXPECT_GT(std::filesystem::file_size(file), 100u) << file;
    const Json profile = read_json(folder / "profile.json");
    EXPECT_EQ(profile.at("fronts").at("rendering").at("psnr").size(), 2u);
    const std::string svg = read_file(folder / "rendering_psnr.svg");
    EXPECT_NE(svg.find("<svg"), std::string::npos);
    EXPECT_EQ(read_file(folder / "rendering_psnr.png").substr(1, 3), "PNG");
}

TEST(Chart, DrawsOnePointAndNone) {
    const auto folder = scratch("chart");
    draw_chart({point("step", "1/512", 0.5, 44)}, psnr, {"one", "s"}, folder / "one");
    draw_chart({}, psnr, {"none", "s"}, folder / "none");
    EXPECT_TRUE(std::filesystem::exists(folder / "one.png"));
    EXPECT_TRUE(std::filesystem::exists(folder / "none.svg"));
    EXPECT_THROW(draw_chart({}, psnr, {"none", "s"}, "/proc/nowhere/chart"), std::exception);
}

TEST(Chart, TicksAreRound) {
    EXPECT_EQ(logarithmic_ticks(0.15, 6), (std::vector<double>{0.2, 0.5, 1, 2, 5}));
    const auto ticks = linear_ticks(23, 67, 7);
    ASSERT_EQ(ticks.size(), 9u);
    EXPECT_EQ(ticks.front(), 25);
    EXPECT_EQ(ticks.back(), 65);
    EXPECT_TRUE(linear_ticks(1, 1, 5).empty());
    EXPECT_TRUE(logarithmic_ticks(0, 1).empty());
}

}  // namespace
}  // namespace fieldgraft
