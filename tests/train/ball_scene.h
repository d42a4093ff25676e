// A scene small enough to be trained on in a test.
#pragma once

#include <cmath>

#include "core/train/trainer.h"

namespace fieldgraft::testing {

// A ball of radius 0.6 whose colour depends on the place, seen by cameras around it: RGBA images drawn by intersection.
inline Tensor ball_image(const Camera& camera) {
    const Rays rays = rays_of_view(camera);
    const Tensor b = (rays.origins * rays.directions).sum(1), c = rays.origins.square().sum(1) - 0.36;
    const Tensor discriminant = b * b - c, hit = discriminant > 0;
    const Tensor t = -b - discriminant.clamp_min(0).sqrt();
    const Tensor point = rays.origins + t.unsqueeze(1) * rays.directions;
    const Tensor color = (0.5 + 0.7 * point).clamp(0, 1);
    const Tensor rgba = at::cat({color, hit.to(at::kFloat).unsqueeze(1)}, 1) * hit.unsqueeze(1);
    return (rgba * 255).round().to(at::kByte).view({camera.height, camera.width, 4}).contiguous();
}

inline TrainingData ball_data() {
    TrainingData data;
    for (int i = 0; i < 8; ++i) {
        const double angle = 0.8 * i, height = i % 2 ? 1.0 : -0.6;
        const Vec3 eye{3 * std::cos(angle), 3 * std::sin(angle), height};
        data.train.cameras.push_back(camera_from_angle(24, 24, 0.7, look_at(eye, {0, 0, 0}, {0, 0, 1})));
        data.train.pixels.push_back(ball_image(data.train.cameras.back()));
        data.train.masks.emplace_back();
    }
    data.validation.cameras = {camera_from_angle(24, 24, 0.7, look_at({2.9, 0.8, 0.3}, {0, 0, 0}, {0, 0, 1}))};
    data.validation.pixels = {ball_image(data.validation.cameras[0])};
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
