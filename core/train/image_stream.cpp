#include "core/train/image_stream.h"

#include <omp.h>

#include <algorithm>
#include <numeric>

#include "core/base/errors.h"
#include "core/base/random.h"
#include "core/base/shape.h"
#include "core/field/torch_parallel.h"

namespace fieldgraft {

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

ImageStream::ImageStream(std::vector<Camera> cameras, Load load, std::size_t window, std::uint64_t seed)
    : cameras_(std::move(cameras)), load_(std::move(load)), window_(window), seed_(seed) {
    if (window < 1 || window > cameras_.size()) {
        throw std::invalid_argument(fmt::format("a window of {} of {} images", window, cameras_.size()));
    }
    shown_.cameras.resize(window);
    shown_.pixels.resize(window);
    shown_.masks.resize(window);
    usable_.resize(window);
}

std::size_t ImageStream::image_at(std::int64_t j) {
    const auto count = static_cast<std::int64_t>(cameras_.size());
    if (j / count != round_) {
        round_ = j / count;
        order_.resize(cameras_.size());
        std::iota(order_.begin(), order_.end(), 0);
        Random random(seed_, 0x696d6167u + static_cast<std::uint64_t>(round_));
        for (std::size_t i = order_.size(); i > 1; --i) {
            std::swap(order_[i - 1], order_[random.below(static_cast<std::uint32_t>(i))]);
        }
    }
    return order_[static_cast<std::size_t>(j % count)];
}

void ImageStream::put(std::int64_t j, Image image) {
    const std::size_t place = static_cast<std::size_t>(j) % window_;
    shown_.cameras[place] = cameras_[image_at(j)];
    // Into the memory of the image that leaves, if it fits: pieces given back and taken anew by turns leave gaps.
    Tensor& pixels = shown_.pixels[place];
    if (pixels.defined() && pixels.sizes() == image.pixels.sizes() &&
        pixels.scalar_type() == image.pixels.scalar_type()) {
        pixels.copy_(image.pixels);
    } else {
        pixels = image.pixels.contiguous();
    }
    shown_.masks[place] = image.mask;
    check_image(shown_, place);
    usable_[place] = !image.mask.defined() || image.mask.any().item<bool>();
}

std::future<ImageStream::Image> ImageStream::start_loading(std::int64_t j) {
    return std::async(std::launch::async, [load = load_, number = image_at(j)] {
        // Beside the pool, not on top of it: this thread brings no team of its own.
        at::get_num_threads();
        omp_set_num_threads(1);
        at::NoGradGuard no_grad;
        return load(number);
    });
}

void ImageStream::fill(std::int64_t first) {
    ahead_.clear();
    std::vector<Image> images(window_);
    std::vector<std::size_t> numbers;
    for (std::size_t i = 0; i < window_; ++i) numbers.push_back(image_at(first + static_cast<std::int64_t>(i)));
    share_out(static_cast<std::int64_t>(window_), [&](std::int64_t i) { images[i] = load_(numbers[i]); });
    for (std::size_t i = 0; i < window_; ++i) put(first + static_cast<std::int64_t>(i), std::move(images[i]));
    first_ = first;
}

ImageStream::Image ImageStream::take(std::int64_t j) {
    // After an image that could not be read the others no longer are the next.
    if (ahead_.empty() || ahead_.front().j != j) {
        ahead_.clear();
        return start_loading(j).get();
    }
    std::future<Image> image = std::move(ahead_.front().image);
    ahead_.pop_front();
    return image.get();
}

void ImageStream::check_usable() const {
    if (std::find(usable_.begin(), usable_.end(), true) == usable_.end())
        input_error("the masks of {} images in a row leave no pixel to train on", window_);
}

const ImageSet& ImageStream::at(std::int64_t iteration) {
    if (window_ == cameras_.size() && first_ >= 0) return shown_;
    const std::int64_t first = window_ == cameras_.size() ? 0 : iteration / iterations_an_image;
    if (first == first_) return shown_;
    const auto window = static_cast<std::int64_t>(window_);
    if (first_ < 0 || first < first_ || first >= first_ + window) fill(first);
    while (first_ < first) {
        put(first_ + window, take(first_ + window));
        ++first_;
    }
    check_usable();
    if (window_ == cameras_.size()) return shown_;
    while (ahead_.size() < images_ahead) {
        const std::int64_t j = first_ + window + static_cast<std::int64_t>(ahead_.size());
        ahead_.push_back({j, start_loading(j)});
    }
    return shown_;
}

}  // namespace fieldgraft
