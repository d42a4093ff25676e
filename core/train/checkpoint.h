// Everything a training run needs to go on as if it had never stopped, in one safetensors file: the field's parameters,
// Adam's moments, the occupancy values, the generator's state and the counters. Written atomically.
#pragma once

#include <filesystem>

#include "core/base/random.h"
#include "core/train/field_optimizer.h"
#include "core/train/occupancy_grid.h"
#include "core/train/step_guard.h"

namespace fieldgraft {

struct TrainState {
    std::shared_ptr<RadianceField> field;
    FieldOptimizer optimizer;
    OccupancyGrid occupancy;
    Random random;
    std::int64_t iteration = 0;
    std::int64_t rays = 4096;  // of the next batch
    std::int64_t samples = 0;  // visible ones fitted so far
    double seconds = 0;        // spent so far, over all runs
    GuardState guard = {};     // steps left out, the learning rate's factor, the running mean squared error
};

// What a run has learnt: the field's parameters ("p."), Adam's moments ("m.", "v."), the occupancy, how often both were
// stepped. Shares the run's memory.
std::map<std::string, Tensor> learnt(const TrainState& state);
// Copies all that back. Throws InputError: something is missing or has another size.
void put_back(TrainState& state, const std::map<std::string, Tensor>& tensors);

// `run` says what is being trained (options, number of images …); a checkpoint of another run is refused. Throws
// Failure instead of writing numbers that are not finite.
void save_checkpoint(const std::filesystem::path& path, const TrainState& state, const Json& run);
// The configuration of the field in a checkpoint. Throws InputError: not a checkpoint.
HashFieldConfig checkpoint_field(const std::filesystem::path& path);
// Throws InputError: of another run, damaged, or not finite.
void load_checkpoint(const std::filesystem::path& path, TrainState& state, const Json& run);

}  // namespace fieldgraft
