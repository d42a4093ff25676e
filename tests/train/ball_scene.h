// A scene small enough to be trained on in a test.
#pragma once

#include "core/scene/ball_views.h"
#include "core/train/trainer.h"

namespace fieldgraft::testing {

inline TrainingData ball_data() {
    TrainingData data;
    data.train.cameras = ball_cameras(8, 24);
    for (const Camera& camera : data.train.cameras) {
        data.train.pixels.push_back(ball_pixels(camera));
        data.train.masks.emplace_back();
    }
    data.validation.cameras = {camera_from_angle(24, 24, 0.7, look_at({2.9, 0.8, 0.3}, {0, 0, 0}, {0, 0, 1}))};
    data.validation.pixels = {ball_pixels(data.validation.cameras[0])};
    data.validation.masks.resize(1);
    return data;
}

inline TrainOptions small_options(std::int64_t iterations) {
    TrainOptions options;
    options.iterations = iterations;
    options.seed = 7;
    options.samples = 4096;
    options.step = 0.04;
    options.occupancy_resolution = 24;
    HashFieldConfig& field = options.field.emplace();
    field.levels = 6;
    field.log2_table_size = 11;
    field.base_resolution = 4;
    field.finest_resolution = 48;
    field.density_hidden = field.color_hidden = 16;
    return options;
}

}  // namespace fieldgraft::testing
