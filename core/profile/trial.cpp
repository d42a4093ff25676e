#include "core/profile/trial.h"

#include <algorithm>
#include <cmath>

#include "core/base/errors.h"

namespace fieldgraft {
namespace {

double figure_of(const Point& point, const Measure& measure) {
    const auto found = point.figures.find(measure.figure);
    const bool usable = found != point.figures.end() && found->is_number();
    const double value = usable ? found->get<double>() : std::nan("");
    return measure.more_is_better ? value : -value;
}

std::vector<Point> earlier_points(const std::filesystem::path& file, const Json& about, bool resume) {
    if (!std::filesystem::exists(file)) return {};
    if (!resume)
        input_error("{}: points of an earlier run are here; go on with --resume, or name another folder",
                    file.parent_path().string());
    const Json saved = read_json(file);
    if (saved.value("about", Json()) != about)
        input_error("{}: these points are of other files or settings; name another folder", file.string());
    std::vector<Point> points;
    for (const Json& point : saved.at("points")) points.push_back(Point::from_json(point));
    return points;
}

void save_points(const std::filesystem::path& file, const Json& about, const std::vector<Point>& points) {
    Json list = Json::array();
    for (const Point& point : points) list.push_back(point.to_json());
    write_json(file, {{"about", about}, {"points", list}});
}

Point measure(const Trial& trial, const Reporter& reporter) {
    Point point{trial.sweep, trial.knob, trial.value, trial.usual, {}, {}};
    // The work's own progress would count from 0 again and again: only warnings and the wish to stop pass.
    const Reporter quiet(
        [&](const Json& event) {
            if (event.at("event") == "warning") reporter.event(event);
        },
        reporter.stop_flag());
    for (int i = 0; i < trial.repeats; ++i) {
        if (reporter.stop_requested()) throw Cancelled();
        point.figures = trial.run(quiet);
        point.seconds.push_back(point.figures.at("seconds").get<double>());
    }
    point.figures["seconds"] = point.median_seconds();
    return point;
}

}  // namespace

double Point::median_seconds() const {
    std::vector<double> sorted = seconds;
    std::sort(sorted.begin(), sorted.end());
    const std::size_t n = sorted.size();
    return n % 2 == 1 ? sorted[n / 2] : 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]);
}

Json Point::to_json() const {
    return {{"sweep", sweep}, {"knob", knob},       {"value", value},
            {"usual", usual}, {"repeats", seconds}, {"figures", figures}};
}

Point Point::from_json(const Json& json) {
    Point point;
    json.at("sweep").get_to(point.sweep);
    json.at("knob").get_to(point.knob);
    json.at("value").get_to(point.value);
    json.at("usual").get_to(point.usual);
    json.at("repeats").get_to(point.seconds);
    point.figures = json.at("figures");
    return point;
}

std::vector<std::size_t> pareto_front(const std::vector<Point>& points, const Measure& measure) {
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (std::isfinite(figure_of(points[i], measure))) order.push_back(i);
    }
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        const double time_a = points[a].median_seconds(), time_b = points[b].median_seconds();
        return time_a != time_b ? time_a < time_b : figure_of(points[a], measure) > figure_of(points[b], measure);
    });
    std::vector<std::size_t> front;
    for (const std::size_t i : order) {
        if (front.empty() || figure_of(points[i], measure) > figure_of(points[front.back()], measure)) {
            front.push_back(i);
        }
    }
    return front;
}

std::vector<Point> run_trials(const std::vector<Trial>& trials, const Json& about, const std::filesystem::path& folder,
                              bool resume, const Reporter& reporter) {
    const std::filesystem::path file = folder / "points.json";
    std::vector<Point> known = earlier_points(file, about, resume), points;
    const Stopwatch watch;
    double measured = 0;
    for (std::size_t i = 0; i < trials.size(); ++i) {
        const Trial& trial = trials[i];
        const auto same = std::find_if(known.begin(), known.end(), [&](const Point& p) {
            return p.sweep == trial.sweep && p.knob == trial.knob && p.value == trial.value;
        });
        if (same != known.end()) {
            points.push_back(*same);
            continue;
        }
        known.push_back(measure(trial, reporter));
        points.push_back(known.back());
        save_points(file, about, known);
        measured += 1;
        const double left = watch.seconds() / measured * static_cast<double>(trials.size() - i - 1);
        reporter.event({{"event", "progress"},
                        {"iteration", i + 1},
                        {"total", trials.size()},
                        {"eta_s", left},
                        {"trial", trial.name()},
                        {"figures", known.back().figures}});
    }
    return points;
}

}  // namespace fieldgraft
