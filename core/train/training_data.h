// The pixels a field is fitted to, and random rays through them.
//
// Images are ImageSets (image_stream.h), all of them in memory or a window of them at a time. A batch holds R rays
// (model coordinates) uniform over all pixels that are not masked, and their colours R×4 in [0, 1], straight alpha (1
// for images without).
#pragma once

#include <memory>
#include <vector>

#include "core/base/random.h"
#include "core/field/geometry.h"
#include "core/render/ray_pass.h"
#include "core/render/samples.h"
#include "core/scene/camera.h"
#include "core/scene/scene.h"
#include "core/train/image_stream.h"

namespace fieldgraft {

struct TrainingData {
    FieldGeometry geometry;
    ImageSet train;                       // with a stream: cameras only
    ImageSet validation;                  // looked at for the report only; may be empty: then training views are
    std::shared_ptr<ImageStream> stream;  // null: all images are in `train`
    // Images without alpha that have one colour all around their edges: it is taken for empty space.
    PlainBackground background;

    // Where rays begin, model units: what is nearer to a camera inside the box is haze that only it would see.
    double near() const;
    // What rays are drawn from.
    const ImageSet& images_at(std::int64_t iteration) const { return stream ? stream->at(iteration) : train; }
    // Throws InputError: no images, an image that does not have its camera's size, masks that leave no pixel.
    void check() const;
};

FieldGeometry geometry_of(const Scene& scene);
// The colour that nine tenths of the outermost pixels have, give or take 8 of 255; none where there is no such colour.
// Looks at up to 24 images.
PlainBackground plain_background(const std::vector<Tensor>& images);
constexpr std::int64_t usual_image_bytes = 2ll << 30;
// Images beyond `image_bytes` in all are streamed, in an order that depends on the seed.
TrainingData training_data_of(const Scene& scene, std::int64_t image_bytes = usual_image_bytes, std::uint64_t seed = 0);

// What a user should know of them, one line each: that they are streamed, what is taken for empty space.
std::vector<std::string> remarks(const TrainingData& data);

struct RayBatch {
    RayBundle rays;
    Tensor colors;  // R×4
};
RayBatch draw_rays(const ImageSet& images, std::int64_t count, Random& random);

}  // namespace fieldgraft
