// What a profile leaves in its folder beside points.json: profile.json (points, fronts, machine), points.csv, and a
// chart of every sweep and measure, SWEEP_FIGURE.svg and .png.
#pragma once

#include "core/profile/trial.h"

namespace fieldgraft {

// The paths that were written.
std::vector<std::filesystem::path> write_report(const std::vector<Point>& points, const Json& about,
                                                const std::filesystem::path& folder);

// One line a point and figure: sweep, knob, value, usual, seconds, least and most of the repeats, then every figure
// that any point has. Fields with commas or quotes are quoted (RFC 4180).
std::string csv_of(const std::vector<Point>& points);

}  // namespace fieldgraft
