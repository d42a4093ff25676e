// What accuracy costs in time, setting by setting: trials are measured one after the other and kept as points.
//
// A sweep (training, rendering, editing, baking) turns one knob at a time away from its usual setting, and a few pairs
// together. A trial's run returns figures with "seconds", the error that its sweep is judged by, and whatever else it
// found. Times are medians of the repeats; figures are the last repeat's.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/base/progress.h"

namespace fieldgraft {

// What a sweep's points are judged by: the figure and whether more of it is better.
struct Measure {
    std::string figure, label, unit;
    bool more_is_better = true;
};

struct Trial {
    std::string sweep, knob, value;  // "rendering", "step", "diagonal/512"
    bool usual = false;              // every other trial differs from this one in its knob alone (or its pair)
    int repeats = 1;
    std::function<Json(const Reporter&)> run;

    std::string name() const { return sweep + "/" + knob + "=" + value; }
};

struct Point {
    std::string sweep, knob, value;
    bool usual = false;
    std::vector<double> seconds;  // of every repeat
    Json figures;

    double median_seconds() const;
    Json to_json() const;
    static Point from_json(const Json& json);
};

// The places (in `points`) of those that nothing beats: none is both as fast and better, or as good and faster. From
// the fastest on. Points without the figure, or where it is not finite, are left out.
std::vector<std::size_t> pareto_front(const std::vector<Point>& points, const Measure& measure);

// Runs the trials that `folder` has no point of yet; points.json there is written after each. `about` says what was
// measured. Throws InputError when the folder holds points and `resume` is not set, or points of something else;
// Cancelled after saving when asked to stop: the trial that was running is lost, no other.
std::vector<Point> run_trials(const std::vector<Trial>& trials, const Json& about, const std::filesystem::path& folder,
                              bool resume, const Reporter& reporter);

}  // namespace fieldgraft
