#include "core/scene/scene.h"

#include <algorithm>
#include <mutex>

#include "core/base/errors.h"
#include "core/base/image.h"
#include "core/base/shape.h"
#include "core/scene/camera_sampler.h"
#include "core/scene/placement.h"
#include "core/scene/transforms_file.h"

namespace fieldgraft {
namespace fs = std::filesystem;

// Decoded images and masks by view index. Copies of a scene share it.
struct Scene::Cache {
    std::mutex mutex;
    std::vector<Tensor> pixels, masks;
};

namespace {

constexpr std::array<const char*, 3> split_names = {"train", "val", "test"};

void check_options(const SceneOptions& options) {
    for (const std::string& split : options.splits)
        if (std::find(split_names.begin(), split_names.end(), split) == split_names.end())
            input_error("no split is called '{}'; train, val and test are", split);
    if (!(options.downscale >= 1) || !std::isfinite(options.downscale))
        input_error("images cannot be reduced by the factor {}; give 1 or more", options.downscale);
    if (!options.box) return;
    for (int i = 0; i < 3; ++i)
        if (!(options.box->min[i] < options.box->max[i]))
            input_error("the scene box runs from {} to {} along {}; the minimum must be smaller", options.box->min[i],
                        options.box->max[i], "xyz"[i]);
}

bool wanted(const SceneOptions& options, const std::string& split) {
    return options.splits.empty() ||
           std::find(options.splits.begin(), options.splits.end(), split) != options.splits.end();
}

std::string joined(const std::vector<std::string>& words) {
    std::string text;
    for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
    return text;
}

// The camera files behind a path, each with the split its name says ("" for a single file).
std::vector<std::pair<fs::path, std::string>> camera_files(const fs::path& path) {
    if (!fs::exists(path)) input_error("no scene at {}: no such file or folder", path.string());
    const bool folder = fs::is_directory(path);
    const fs::path home = folder ? path : path.parent_path();
    const std::string file = folder ? "" : path.filename().string();
    std::vector<std::pair<fs::path, std::string>> family;
    bool member = folder;
    for (const char* split : split_names) {
        const std::string name = fmt::format("transforms_{}.json", split);
        member = member || file == name;
        if (fs::is_regular_file(home / name)) family.emplace_back(home / name, split);
    }
    if (!folder && !member) return {{path, ""}};
    if (!family.empty()) return family;
    if (fs::is_regular_file(home / "transforms.json")) return {{home / "transforms.json", ""}};
    const bool colmap = fs::exists(home / "sparse") || fs::exists(home / "colmap");
    input_error("{}: neither transforms_train.json nor transforms.json in it; {}", path.string(),
                colmap ? "convert the COLMAP model first (ns-process-data writes transforms.json)"
                       : "give the folder of a NeRF-synthetic, nerfstudio or instant-ngp scene");
}

// Linear light with premultiplied alpha, as EXR files hold it, to straight sRGB values (IEC 61966-2-1).
Tensor display_values(const Tensor& linear) {
    Tensor color = linear.narrow(2, 0, 3);
    if (linear.size(2) == 4) color = color / linear.narrow(2, 3, 1).clamp_min(1e-6);
    color = color.clamp(0, 1);
    color = at::where(color <= 0.0031308, color * 12.92, 1.055 * color.clamp_min(0.0031308).pow(1 / 2.4) - 0.055);
    return linear.size(2) == 4 ? at::cat({color, linear.narrow(2, 3, 1)}, 2) : color;
}

Tensor with_channels(const Tensor& bytes, bool alpha) {
    if (!alpha || bytes.size(2) == 4) return bytes;
    return at::cat({bytes, at::full({bytes.size(0), bytes.size(1), 1}, 255, at::kByte)}, 2);
}

std::string short_name(const View& view) {
    if (view.image.empty()) return view.camera.name;
    return (view.image.parent_path().filename() / view.image.stem()).string();
}

bool answers_to(const View& view, const std::string& name) {
    if (view.camera.name == name) return true;
    return !view.image.empty() && (view.image.filename().string() == name || short_name(view) == name);
}

View make_view(const FileFrame& frame, double downscale) {
    View view;
    view.camera = downscale > 1 ? scaled(frame.camera, 1 / downscale) : frame.camera;
    view.image = frame.image;
    view.mask = frame.mask;
    view.split = frame.split;
    return view;
}

}  // namespace

Scene::Scene() : cache_(std::make_shared<Cache>()) {}

Scene Scene::load(const fs::path& path, const SceneOptions& options) {
    check_options(options);
    const auto needed = [&](const std::string& split) { return wanted(options, split); };
    Scene scene;
    scene.downscale_ = options.downscale;
    const fs::path full = fs::weakly_canonical(path);
    scene.name_ = fs::is_directory(full) ? full.filename().string() : full.parent_path().filename().string();
    std::vector<TransformsFile> files;
    for (const auto& [file, split] : camera_files(path)) files.push_back(read_transforms(file, split, needed));

    // One placement for all splits, whichever are wanted, by all cameras of the first file.
    std::vector<Camera> placing;
    bool placing_alpha = false;
    for (const FileFrame& frame : files.front().frames) {
        placing.push_back(frame.camera);
        placing_alpha = placing_alpha || frame.has_alpha;
    }
    for (TransformsFile& file : files) {
        for (const FileFrame& frame : file.frames) {
            if (!needed(frame.split)) continue;
            scene.views_.push_back(make_view(frame, options.downscale));
            scene.has_alpha_ = scene.has_alpha_ || frame.has_alpha;
        }
        scene.warnings_.insert(scene.warnings_.end(), file.warnings.begin(), file.warnings.end());
    }
    if (scene.views_.empty())
        input_error("{}: no views of the split{} {}; leave the choice out or choose another", path.string(),
                    options.splits.size() > 1 ? "s" : "", joined(options.splits));
    if (placing.empty()) {
        for (const View& view : scene.views_) placing.push_back(view.camera);
        placing_alpha = scene.has_alpha_;
    }
    const Placement placement = place_scene(files.front(), placing, placing_alpha);
    for (View& view : scene.views_) view.camera = transformed(view.camera, placement.file_to_model);
    scene.frame_ = compose(placement.file_to_model, files.front().applied);
    scene.bounds_ = options.box ? mapped_box(*options.box, scene.frame_) : placement.box;
    scene.finish();
    return scene;
}

Scene Scene::from_images(std::vector<Camera> cameras, const std::vector<Tensor>& images, const Bounds& bounds,
                         const std::vector<std::string>& splits) {
    if (cameras.empty() || cameras.size() != images.size() || (!splits.empty() && splits.size() != cameras.size()))
        throw std::invalid_argument(fmt::format("Scene::from_images: {} cameras, {} images, {} splits", cameras.size(),
                                                images.size(), splits.size()));
    Scene scene;
    scene.name_ = "scene";
    scene.bounds_ = bounds;
    for (std::size_t i = 0; i < cameras.size(); ++i) {
        check_camera(cameras[i]);
        const Tensor& image = images[i];
        if (!image.defined() || image.dim() != 3 || image.size(0) != cameras[i].height ||
            image.size(1) != cameras[i].width || (image.size(2) != 3 && image.size(2) != 4))
            throw std::invalid_argument(fmt::format("Scene::from_images: image {} is {}, its camera {}×{}", i,
                                                    shape_text(image), cameras[i].height, cameras[i].width));
        View view;
        view.camera = std::move(cameras[i]);
        view.split = splits.empty() ? "train" : splits[i];
        scene.has_alpha_ = scene.has_alpha_ || image.size(2) == 4;
        scene.views_.push_back(std::move(view));
    }
    scene.finish();
    for (std::size_t i = 0; i < images.size(); ++i)
        scene.cache_->pixels[i] =
            with_channels(to_bytes(images[i].detach().to(at::kCPU, at::kFloat)), scene.has_alpha_);
    return scene;
}

void Scene::finish() {
    for (std::size_t i = 0; i < views_.size(); ++i) views_[i].index = i;
    cache_->pixels.resize(views_.size());
    cache_->masks.resize(views_.size());
    std::vector<Camera> seen = cameras("train");
    if (seen.empty())
        for (const View& view : views_) seen.push_back(view.camera);
    centre_ = focus_point(seen);
    forward_facing_ = is_forward_facing(seen);
    radius_range_ = {std::numeric_limits<double>::infinity(), 0};
    for (const Camera& camera : seen) {
        const double radius = length(camera.position() - centre_);
        radius_range_ = {std::min(radius_range_[0], radius), std::max(radius_range_[1], radius)};
    }
}

std::vector<View> Scene::views(const std::string& split) const {
    std::vector<View> result;
    for (const View& view : views_)
        if (view.split == split) result.push_back(view);
    return result;
}

std::vector<View> Scene::validation_views() const {
    for (const char* split : {"val", "test"})
        if (auto list = views(split); !list.empty()) return list;
    std::vector<View> result;
    for (std::size_t i = 0; i < views_.size(); i += 8) result.push_back(views_[i]);
    return result;
}

std::vector<Camera> Scene::cameras(const std::string& split) const {
    std::vector<Camera> result;
    for (const View& view : views_)
        if (view.split == split) result.push_back(view.camera);
    return result;
}

const View& Scene::view(const std::string& name, const std::string& split) const {
    std::vector<const View*> found;
    for (const View& view : views_)
        if (answers_to(view, name) && (split.empty() || view.split == split)) found.push_back(&view);
    if (found.size() == 1) return *found.front();
    std::string some;
    for (std::size_t i = 0; i < std::min<std::size_t>(views_.size(), 3); ++i) some += short_name(views_[i]) + ", ";
    if (found.empty())
        input_error("scene {} has no view '{}'{}; it has {}… ({} views)", name_, name,
                    split.empty() ? "" : " in its split " + split, some, views_.size());
    input_error("scene {}: the view name '{}' fits {} and {}; give the longer form", name_, name, short_name(*found[0]),
                short_name(*found[1]));
}

Tensor Scene::pixels(const View& view) const {
    if (view.index >= views_.size())
        throw std::invalid_argument(fmt::format("Scene: view {} of {}", view.index, views_.size()));
    const View& own = views_[view.index];
    {
        const std::lock_guard lock(cache_->mutex);
        if (cache_->pixels[own.index].defined()) return cache_->pixels[own.index];
    }
    const Tensor bytes = decoded(own);
    const std::lock_guard lock(cache_->mutex);
    if (!cache_->pixels[own.index].defined()) cache_->pixels[own.index] = bytes;
    return cache_->pixels[own.index];
}

Tensor Scene::decoded(const View& view) const {
    const View& own = views_.at(view.index);
    if (own.image.empty()) return pixels(own).clone();  // a scene out of memory
    std::string extension = own.image.extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return std::tolower(c); });
    Tensor image;
    if (extension == ".exr") {
        image = display_values(read_image(own.image));
    } else {
        // Bytes stay bytes where they can: floats of a large image are many times its size.
        const Tensor bytes = read_bytes(own.image);
        if (bytes.size(0) == own.camera.height && bytes.size(1) == own.camera.width)
            return with_channels(bytes, has_alpha_);
        image = bytes.to(at::kFloat).div_(255.0f);
    }
    return with_channels(to_bytes(resize_image(image, own.camera.height, own.camera.width)), has_alpha_);
}

Tensor Scene::image(const View& view) const {
    return pixels(view).to(at::kFloat).div_(255.0f);
}

Tensor Scene::mask(const View& view) const {
    if (view.index >= views_.size())
        throw std::invalid_argument(fmt::format("Scene: view {} of {}", view.index, views_.size()));
    const View& own = views_[view.index];
    if (own.mask.empty()) return Tensor();
    const std::lock_guard lock(cache_->mutex);
    Tensor& kept = cache_->masks[own.index];
    if (!kept.defined()) kept = decoded_mask(own);
    return kept;
}

Tensor Scene::decoded_mask(const View& view) const {
    const View& own = views_.at(view.index);
    if (own.mask.empty()) return Tensor();
    const Tensor brightness = read_image(own.mask).narrow(2, 0, 3).amax(2, true);
    return resize_image(brightness, own.camera.height, own.camera.width).squeeze(2) >= 0.5;
}

}  // namespace fieldgraft
