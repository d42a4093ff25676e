// The pixels a field is fitted to, and random rays through them.
//
// Pixels are H×W×C uint8, C = 3 or 4 (straight alpha), sRGB values, one image a camera; masks H×W bool, false = ignore,
// undefined = no mask. A batch holds R rays (model coordinates) uniform over all pixels that are not masked, and their
// colours R×4 in [0, 1], straight alpha (1 for images without).
#pragma once

#include <vector>

#include "core/base/random.h"
#include "core/field/geometry.h"
#include "core/render/samples.h"
#include "core/scene/camera.h"
#include "core/scene/scene.h"

namespace fieldgraft {

struct ImageSet {
    std::vector<Camera> cameras;
    std::vector<Tensor> pixels;
    std::vector<Tensor> masks;
};

struct TrainingData {
    FieldGeometry geometry;
    ImageSet train;
    ImageSet validation;  // looked at for the report only; may be empty: then training views are
    // Throws InputError: no images, an image that does not have its camera's size, masks that leave no pixel.
    void check() const;
};

FieldGeometry geometry_of(const Scene& scene);
TrainingData training_data_of(const Scene& scene);

struct RayBatch {
    RayBundle rays;
    Tensor colors;  // R×4
};
RayBatch draw_rays(const ImageSet& images, std::int64_t count, Random& random);

}  // namespace fieldgraft
