#include "core/train/training_data.h"

#include "core/base/errors.h"

namespace fieldgraft {
namespace {

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
    bool any = stream != nullptr;  // which looks at images when it reads them
    for (const ImageSet* set : {&train, &validation}) {
        if (set == &train && stream != nullptr) continue;
        if (set->pixels.size() != set->cameras.size() || set->masks.size() != set->cameras.size()) {
            throw std::invalid_argument("as many images and masks as cameras are needed");
        }
        for (std::size_t i = 0; i < set->cameras.size(); ++i) check_image(*set, i);
    }
    for (const Tensor& mask : train.masks) any = any || !mask.defined() || mask.any().item<bool>();
    if (!any) input_error("the masks leave no pixel to train on");
}

double TrainingData::near() const {
    constexpr double share = 0.05;  // of the usual distance to what the cameras look at
    const auto inside = [&](const Camera& camera) {
        const Vec3 p = camera.position();
        for (int c = 0; c < 3; ++c) {
            if (p[c] < geometry.box_min[c] || p[c] > geometry.box_max[c]) return false;
        }
        return true;
    };
    const auto& cameras = train.cameras;
    return std::any_of(cameras.begin(), cameras.end(), inside) ? share * geometry.radius_range[0] : 0;
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

namespace {

// How many images of these sizes fit into so many bytes; fewer than 2³² pixels, which are drawn by number.
std::size_t images_that_fit(const std::vector<View>& views, int channels, std::int64_t bytes) {
    std::int64_t largest = 1;
    for (const View& view : views) {
        largest = std::max(largest, static_cast<std::int64_t>(view.camera.width) * view.camera.height);
    }
    const std::int64_t most = std::min<std::int64_t>(bytes / (channels * largest), ((1ll << 32) - 1) / largest);
    return static_cast<std::size_t>(std::clamp<std::int64_t>(most, 1, static_cast<std::int64_t>(views.size())));
}

}  // namespace

PlainBackground plain_background(const std::vector<Tensor>& images) {
    constexpr std::size_t most = 24;
    constexpr double tolerance = 8;
    std::vector<Tensor> edges;
    const std::size_t count = std::min(most, images.size());
    for (std::size_t i = 0; i < count; ++i) {
        const Tensor& image = images[i * images.size() / count];
        if (image.size(2) != 3) return {};
        const std::int64_t height = image.size(0), width = image.size(1);
        for (const std::int64_t y : {std::int64_t{0}, height - 1}) edges.push_back(image[y]);
        for (const std::int64_t x : {std::int64_t{0}, width - 1}) edges.push_back(image.select(1, x));
    }
    if (edges.empty()) return {};
    const Tensor pixels = at::cat(edges, 0).to(at::kFloat);
    const Tensor middle = std::get<0>(pixels.median(0));
    const Tensor alike = ((pixels - middle).abs() <= tolerance).all(1);
    if (alike.to(at::kFloat).mean().item<double>() < 0.9) return {};
    const Tensor color = middle / 255;
    return std::array{color[0].item<float>(), color[1].item<float>(), color[2].item<float>()};
}

namespace {

// Of the images in memory, or of some that are decoded for it.
PlainBackground background_of(const Scene& scene, const TrainingData& data) {
    if (scene.has_alpha()) return {};
    if (data.stream == nullptr) return plain_background(data.train.pixels);
    const std::vector<View> views = scene.views("train");
    std::vector<Tensor> some;
    for (std::size_t i = 0; i < 24; ++i) some.push_back(scene.decoded(views[i * views.size() / 24]));
    return plain_background(some);
}

}  // namespace

TrainingData training_data_of(const Scene& scene, std::int64_t image_bytes, std::uint64_t seed) {
    // Four views tell the quality well enough for a report.
    std::vector<View> all = scene.validation_views(), some;
    const std::size_t count = std::min<std::size_t>(4, all.size());
    for (std::size_t i = 0; i < count; ++i) some.push_back(all[i * all.size() / count]);
    const std::vector<View> train = scene.views("train");
    TrainingData data{geometry_of(scene), {}, images_of(scene, some), nullptr, {}};
    const std::size_t window = train.empty() ? 0 : images_that_fit(train, scene.has_alpha() ? 4 : 3, image_bytes);
    if (window == train.size()) {
        data.train = images_of(scene, train);
    } else {
        for (const View& view : train) data.train.cameras.push_back(view.camera);
        const auto source = std::make_shared<const Scene>(scene);
        const auto views = std::make_shared<const std::vector<View>>(train);
        const auto load = [source, views](std::size_t i) {
            return ImageStream::Image{source->decoded(views->at(i)), source->decoded_mask(views->at(i))};
        };
        data.stream = std::make_shared<ImageStream>(data.train.cameras, load, window, seed);
    }
    data.background = background_of(scene, data);
    for (int c = 0; data.background && c < 3; ++c) data.geometry.background[c] = (*data.background)[c];
    return data;
}

std::vector<std::string> remarks(const TrainingData& data) {
    std::vector<std::string> lines;
    if (data.stream != nullptr) {
        lines.push_back(fmt::format("{} training images are more than --image-memory: {} at a time are in memory",
                                    data.stream->size(), data.stream->window()));
    }
    if (data.background) {
        const auto& b = *data.background;
        lines.push_back(fmt::format(
            "the pictures have no alpha and one colour around their edges (#{:02x}{:02x}{:02x}): it is taken "
            "for empty space",
            std::lround(255 * b[0]), std::lround(255 * b[1]), std::lround(255 * b[2])));
    }
    return lines;
}

RayBatch draw_rays(const ImageSet& images, std::int64_t count, Random& random) {
    std::vector<std::int64_t> first{0};  // pixels before each image
    for (const Tensor& pixels : images.pixels) first.push_back(first.back() + pixels.size(0) * pixels.size(1));
    const Tensor view = at::empty({count}, at::kLong), pixels = at::empty({count, 2}, at::kLong);
    const Tensor colors = at::empty({count, 4}, at::kFloat);
    std::int64_t *views = view.mutable_data_ptr<std::int64_t>(), *xy = pixels.mutable_data_ptr<std::int64_t>();
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
    }
    // Which pixels is drawn one after the other; what they are is looked up by all threads.
    float* out = colors.mutable_data_ptr<float>();
    at::parallel_for(0, count, 512, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t r = begin; r < end; ++r) {
            const Tensor& image = images.pixels[views[r]];
            const std::int64_t channels = image.size(2);
            const std::uint8_t* source =
                image.const_data_ptr<std::uint8_t>() + (xy[2 * r + 1] * image.size(1) + xy[2 * r]) * channels;
            for (int c = 0; c < 4; ++c) out[4 * r + c] = c < channels ? static_cast<float>(source[c]) / 255.0f : 1.0f;
        }
    });
    const Rays rays = rays_through_pixels(images.cameras, view, pixels);
    return {{rays.origins, rays.directions}, colors};
}

}  // namespace fieldgraft
