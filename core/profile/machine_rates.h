// How fast this machine is at what training, drawing and baking are made of, and what they will therefore take.
//
// Measured on a ball (core/scene/ball_views.h) in under ten seconds, `fieldgraft profile --calibrate`, and kept for
// later: $XDG_CACHE_HOME/fieldgraft/machine.json, else ~/.cache/fieldgraft/machine.json. Rates of another machine or
// another number of threads are not read.
//
//   ns a unit of work = base + multiply-adds of the networks · product + (log₂ table entries − 16) · table
//
// A unit: a visible sample that is fitted; one that a picture looks at; a voxel that a
// bake holds. Predictions leave out
// reading and writing files.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/field/radiance_field.h"
#include "core/scene/camera.h"

namespace fieldgraft {

struct WorkRate {
    double base = 0, product = 0, table = 0;  // ns
    double of(const HashFieldConfig& field) const;
};

// A field that was measured with, and what a unit of work took.
struct MeasuredRate {
    HashFieldConfig field;
    double ns = 0;
};
// The rate through three measurements: a field, the same with a larger table, that with wider networks. What noise
// would make negative is 0.
WorkRate rate_through(const std::array<MeasuredRate, 3>& measured);

struct MachineRates {
    std::string machine;
    int threads = 0;
    WorkRate fit, draw, voxel;
    double ray = 0;   // ns a ray that is drawn, beside its samples
    double bake = 0;  // ns a bake, beside its voxels

    // How many times faster this machine trains a short run's field than the one on which TrainOptions' budgets were
    // chosen.
    double speed() const;
    Json to_json() const;
    static MachineRates from_json(const Json& json);
};

// Throws Cancelled.
MachineRates measure_machine(const Reporter& reporter);

std::filesystem::path machine_file();
void save_rates(const MachineRates& rates);
// Those of this machine and so many threads as it runs with; none: not measured yet, or unreadable.
std::optional<MachineRates> load_rates();

// Seconds that so many visible samples take to be fitted.
double training_seconds(const MachineRates& rates, const HashFieldConfig& field, double samples);
// Seconds of a picture. Marches every 64th ray to count its samples.
double view_seconds(const MachineRates& rates, const RadianceField& field, const Camera& camera);
// Seconds of bakes of so many voxels along the thing's longest edge.
std::vector<double> bake_seconds(const MachineRates& rates, const RadianceField& field,
                                 const std::vector<int>& resolutions);

}  // namespace fieldgraft
