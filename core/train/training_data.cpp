#include "core/train/training_data.h"

#include "core/base/errors.h"
#include "core/base/shape.h"

namespace fieldgraft {
namespace {

void check_image(const ImageSet& set, std::size_t i) {
    const Tensor &pixels = set.pixels[i], &mask = set.masks[i];
    const Camera& camera = set.cameras[i];
    const bool fits = pixels.dim() == 3 && pixels.size(0) == camera.height && pixels.size(1) == camera.width &&
                      (pixels.size(2) == 3 || pixels.size(2) == 4) && pixels.scalar_type() == at::kByte;
    if (!fits) {
        input_error("image {} (\"{}\") is {}; its camera needs bytes {}×{}×3 or ×4", i, camera.name, shape_text(pixels),
                    camera.height, camera.width);
    }
    if (mask.defined() && mask.sizes() != pixels.sizes().slice(0, 2)) {
        input_error("the mask of image {} (\"{}\") is {}, not {}×{}", i, camera.name, shape_text(mask), camera.height,
                    camera.width);
    }
}

ImageSet images_of(const Scene& scene, const std::vector<View>& views) {
    ImageSet set;
    for (const View& view : views) {
        set.cameras.push_back(view.camera);
        set.pixels.push_back(scene.pixels(view).contiguous());
        set.masks.push_back(scene.mask(view));
    }
    return set;
}

bool masked_out(const ImageSet& images, std::int64_t view, std::int64_t x, std::int64_t y) {
    const Tensor& mask = images.masks[view];
    return mask.defined() && !mask.const_data_ptr<bool>()[y * mask.size(1) + x];
}

}  // namespace

void TrainingData::check() const {
    if (train.cameras.empty()) input_error("the scene has no training images");
    bool any = false;
    for (const ImageSet* set : {&train, &validation}) {
        if (set->pixels.size() != set->cameras.size() || set->masks.size() != set->cameras.size()) {
            throw std::invalid_argument("as many images and masks as cameras are needed");
        }
        for (std::size_t i = 0; i < set->cameras.size(); ++i) check_image(*set, i);
    }
    for (const Tensor& mask : train.masks) any = any || !mask.defined() || mask.any().item<bool>();
    if (!any) input_error("the masks leave no pixel to train on");
}

FieldGeometry geometry_of(const Scene& scene) {
    FieldGeometry geometry;
    geometry.box_min = scene.bounds().min;
    geometry.box_max = scene.bounds().max;
    geometry.frame = scene.frame().matrix;
    geometry.up = scene.up();
    geometry.centre = scene.centre();
    geometry.radius_range = scene.radius_range();
    const std::vector<Camera> cameras = scene.cameras("train");
    if (!cameras.empty()) {
        const Camera& camera = cameras.front();
        geometry.image_width = camera.width;
        geometry.image_height = camera.height;
        geometry.focal_x = camera.fx;
        geometry.focal_y = camera.fy;
        geometry.principal_x = camera.cx;
        geometry.principal_y = camera.cy;
    }
    geometry.white_background = scene.has_alpha();
    geometry.forward_facing = scene.forward_facing();
    return geometry;
}

TrainingData training_data_of(const Scene& scene) {
    // Four views tell the quality well enough for a report.
    std::vector<View> all = scene.validation_views(), some;
    const std::size_t count = std::min<std::size_t>(4, all.size());
    for (std::size_t i = 0; i < count; ++i) some.push_back(all[i * all.size() / count]);
    return {geometry_of(scene), images_of(scene, scene.views("train")), images_of(scene, some)};
}

RayBatch draw_rays(const ImageSet& images, std::int64_t count, Random& random) {
    std::vector<std::int64_t> first{0};  // pixels before each image
    for (const Tensor& pixels : images.pixels) first.push_back(first.back() + pixels.size(0) * pixels.size(1));
    const Tensor view = at::empty({count}, at::kLong), pixels = at::empty({count, 2}, at::kLong);
    const Tensor colors = at::empty({count, 4}, at::kFloat);
    std::int64_t *views = view.mutable_data_ptr<std::int64_t>(), *xy = pixels.mutable_data_ptr<std::int64_t>();
    float* out = colors.mutable_data_ptr<float>();
    for (std::int64_t r = 0; r < count; ++r) {
        std::int64_t v = 0, x = 0, y = 0;
        do {
            const std::int64_t number = random.below(static_cast<std::uint32_t>(first.back()));
            v = std::upper_bound(first.begin(), first.end(), number) - first.begin() - 1;
            const std::int64_t width = images.pixels[v].size(1);
            x = (number - first[v]) % width;
            y = (number - first[v]) / width;
        } while (masked_out(images, v, x, y));
        views[r] = v;
        xy[2 * r] = x;
        xy[2 * r + 1] = y;
        const std::int64_t channels = images.pixels[v].size(2);
        const std::uint8_t* source =
            images.pixels[v].const_data_ptr<std::uint8_t>() + (y * images.pixels[v].size(1) + x) * channels;
        for (int c = 0; c < 4; ++c) out[4 * r + c] = c < channels ? static_cast<float>(source[c]) / 255.0f : 1.0f;
    }
    const Rays rays = rays_through_pixels(images.cameras, view, pixels);
    return {{rays.origins, rays.directions}, colors};
}

}  // namespace fieldgraft
