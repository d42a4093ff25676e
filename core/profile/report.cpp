#include "core/profile/report.h"

#include <algorithm>
#include <set>

#include "core/base/files.h"
#include "core/profile/chart.h"
#include "core/profile/sweeps.h"

namespace fieldgraft {
namespace {

std::string quoted(const std::string& field) {
    if (field.find_first_of(",\"\n") == std::string::npos) return field;
    std::string out = "\"";
    for (const char c : field) out += c == '"' ? std::string("\"\"") : std::string(1, c);
    return out + "\"";
}

std::vector<Point> of_sweep(const std::vector<Point>& points, const std::string& sweep) {
    std::vector<Point> some;
    std::copy_if(points.begin(), points.end(), std::back_inserter(some),
                 [&](const Point& p) { return p.sweep == sweep; });
    return some;
}

Json front_of(const std::vector<Point>& points, const Measure& measure) {
    Json front = Json::array();
    for (const std::size_t i : pareto_front(points, measure)) {
        const Point& p = points[i];
        front.push_back({{"knob", p.knob},
                         {"value", p.value},
                         {"seconds", p.median_seconds()},
                         {measure.figure, p.figures.at(measure.figure)}});
    }
    return front;
}

}  // namespace

std::string csv_of(const std::vector<Point>& points) {
    std::set<std::string> figures;
    for (const Point& p : points) {
        for (const auto& [name, value] : p.figures.items()) {
            if (value.is_number() && name != "seconds") figures.insert(name);
        }
    }
    std::string text = "sweep,knob,value,usual,seconds,least_seconds,most_seconds";
    for (const std::string& name : figures) text += "," + name;
    for (const Point& p : points) {
        const auto [least, most] = std::minmax_element(p.seconds.begin(), p.seconds.end());
        text += fmt::format("\n{},{},{},{},{:.6g},{:.6g},{:.6g}", p.sweep, quoted(p.knob), quoted(p.value),
                            p.usual ? 1 : 0, p.median_seconds(), *least, *most);
        for (const std::string& name : figures) {
            const auto found = p.figures.find(name);
            text += found == p.figures.end() ? "," : fmt::format(",{:.6g}", found->get<double>());
        }
    }
    return text + "\n";
}

std::vector<std::filesystem::path> write_report(const std::vector<Point>& points, const Json& about,
                                                const std::filesystem::path& folder) {
    std::vector<std::filesystem::path> written;
    Json list = Json::array(), fronts = Json::object();
    for (const Point& point : points) list.push_back(point.to_json());
    for (const std::string& sweep : known_sweeps()) {
        const std::vector<Point> some = of_sweep(points, sweep);
        if (some.empty()) continue;
        for (const Measure& measure : measures_of(sweep)) {
            const std::filesystem::path base = folder / (sweep + "_" + measure.figure);
            const std::string title = about.value("name", std::string("field")) + ": what " + sweep + " costs";
            draw_chart(some, measure, {title, time_of(sweep)}, base);
            written.push_back(base.string() + ".svg");
            written.push_back(base.string() + ".png");
            fronts[sweep][measure.figure] = front_of(some, measure);
        }
    }
    write_json(folder / "profile.json", {{"about", about}, {"points", list}, {"fronts", fronts}});
    write_file(folder / "points.csv", csv_of(points));
    written.push_back(folder / "profile.json");
    written.push_back(folder / "points.csv");
    return written;
}

}  // namespace fieldgraft
