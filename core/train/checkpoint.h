// Everything a training run needs to go on as if it had never stopped, in one safetensors file: the field's parameters,
// Adam's moments, the occupancy values, the generator's state and the counters. Written atomically.
#pragma once

#include <filesystem>

#include "core/base/random.h"
#include "core/train/field_optimizer.h"
#include "core/train/occupancy_grid.h"

namespace fieldgraft {

struct TrainState {
    std::shared_ptr<RadianceField> field;
    FieldOptimizer optimizer;
    OccupancyGrid occupancy;
    Random random;
    std::int64_t iteration = 0;
    std::int64_t rays = 4096;  // of the next batch
    std::int64_t samples = 0;  // visible ones fitted so far
    std::int64_t skipped = 0;  // steps that were left out for NaN or infinite gradients
    double seconds = 0;        // spent so far, over all runs
    double error = 0;          // running mean squared error of the training rays
    double rate_scale = 1;     // the learning rate's factor after steps that were skipped
};

// `run` says what is being trained (options, number of images …); a checkpoint of another run is refused.
void save_checkpoint(const std::filesystem::path& path, const TrainState& state, const Json& run);
// The configuration of the field in a checkpoint. Throws InputError: not a checkpoint.
HashFieldConfig checkpoint_field(const std::filesystem::path& path);
// Throws InputError.
void load_checkpoint(const std::filesystem::path& path, TrainState& state, const Json& run);

}  // namespace fieldgraft
