// A picture of points: what they are judged by against the time they took, one colour a knob, the front that nothing
// beats as a line, usual settings ringed. Drawn with Cairo.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/profile/trial.h"

namespace fieldgraft {

struct ChartText {
    std::string title, time;  // "Rendering lego", "seconds a view"
};

// Writes base.svg and base.png (`base` without extension), each whole or not at all. Points without the measure's
// figure are left out. Throws Failure when a file cannot be written.
void draw_chart(const std::vector<Point>& points, const Measure& measure, const ChartText& text,
                const std::filesystem::path& base);

// Round numbers that cut [low, high] into about `count` parts, and for logarithmic axes 1, 2 and 5 of every decade.
std::vector<double> linear_ticks(double low, double high, int count);
std::vector<double> logarithmic_ticks(double low, double high);

}  // namespace fieldgraft
