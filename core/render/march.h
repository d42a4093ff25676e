// Marching rays through the box: equal steps, cells of an occupancy grid that are empty are skipped.
//
// The grid is R×R×R uint8 (z, y, x) over the field's box. A ray's samples lie at t = near + (k + ½ + jitter)·step
// inside the box; jitter ∈ [−½, ½) is one number a ray (0 when there is no random generator): cameras see the same
// samples again.
#pragma once

#include "core/base/random.h"
#include "core/field/radiance_field.h"
#include "core/render/samples.h"

namespace fieldgraft {

struct MarchOptions {
    double step = 0;  // model units; 0: the box diagonal / 1024
    double near = 0;
    Random* jitter = nullptr;
    double min_transmittance = 1e-4;  // sample_visible: what lies behind this is left out
};

// Throw std::invalid_argument: rays that are not float32 R×3 on the CPU, a min_transmittance outside [0, 1).
void check_rays(const RayBundle& rays);
void check_transmittance(const MarchOptions& options);

// R numbers in [−½, ½); undefined without a generator.
Tensor draw_jitter(Random* random, std::int64_t rays);

// The length of an interval that the options ask for.
double march_step(const FieldGeometry& geometry, const MarchOptions& options);

// All samples in occupied cells. `occupancy` may be undefined: then everywhere in the box.
Samples march(const FieldGeometry& geometry, const Tensor& occupancy, const RayBundle& rays,
              const MarchOptions& options);

// What an edit needs beside f's own samples. Grids of cells over the box at any resolution, uint8.
struct EditCells {
    Tensor extra;          // where density may be added: marched beside f's occupied cells; f's density is 0 there
    Tensor transparent;    // where density may be taken away: what is here hides nothing
    int extra_stride = 1;  // so many steps outside f's cells become one sample of their joint length
};

// march(), then f's densities without gradients, then only the samples a ray can see (transmittance before the sample
// above min_transmittance). Exact: transmittances are of the full march.
struct VisibleSamples {
    Samples samples;
    Tensor density;   // N, f's, no gradient
    Tensor features;  // N×feature_size, f's, no gradient
};
VisibleSamples sample_visible(const RadianceField& field, const RayBundle& rays, const MarchOptions& options,
                              const EditCells& cells = {});

}  // namespace fieldgraft
