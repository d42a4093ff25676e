// Forward and backward of one batch of training rays, all threads at work (ray_pass.h).
#pragma once

#include <vector>

#include "core/kernels/field_mlp_simd.h"
#include "core/render/ray_pass.h"
#include "core/train/training_data.h"

namespace fieldgraft {

struct BatchOptions {
    Precision precision = Precision::float32;
    double step = 0, near = 0;   // of the march, model units
    PlainBackground background;  // of TrainingData
};

// What the ranges of the batch leave; the same bits with any number of threads. `random` draws a jitter for every ray.
std::vector<RangeFit> fit_batch(const RadianceField& field, const MarchGrid& cells, const RayBatch& batch,
                                const BatchOptions& options, Random& random);

}  // namespace fieldgraft
