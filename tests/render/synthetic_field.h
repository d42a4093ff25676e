// A field for render tests: its density is set by an occupancy and a random table, so that rays see something uneven.
#pragma once

#include "core/base/random.h"
#include "core/field/radiance_field.h"
#include "core/render/samples.h"

namespace fieldgraft::testing {

inline Tensor random_tensor(at::IntArrayRef shape, std::uint64_t seed, float low, float high) {
    Tensor out = at::empty(shape, at::kFloat);
    Random random(seed);
    float* values = out.mutable_data_ptr<float>();
    for (std::int64_t i = 0; i < out.numel(); ++i) values[i] = random.uniform(low, high);
    return out;
}

inline RadianceField uneven_field(float density_scale = 8) {
    HashFieldConfig config;
    config.levels = 4;
    config.log2_table_size = 10;
    config.base_resolution = 4;
    config.finest_resolution = 32;
    RadianceField field(config, {}, 5);
    {
        at::NoGradGuard no_grad;
        Tensor table = field.parameters().at("encoding.table");
        table.copy_(random_tensor(table.sizes(), 6, -1, 1));
        Tensor last = field.parameters().at("density.1");
        last[0].mul_(density_scale);
    }
    field.freeze();
    return field;
}

// Rays from a sphere of radius 4 towards points near the centre.
inline RayBundle inward_rays(std::int64_t count, std::uint64_t seed) {
    const Tensor from = random_tensor({count, 3}, seed, -1, 1), to = random_tensor({count, 3}, seed + 1, -1, 1);
    const Tensor origins = 4 * from / from.norm(2, 1, true);
    const Tensor ways = to - origins;
    return {origins, ways / ways.norm(2, 1, true)};
}

}  // namespace fieldgraft::testing
