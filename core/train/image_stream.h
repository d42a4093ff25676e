// Training images that do not fit into memory: a window over all of them, moved on by one image every few iterations.
//
// The images come in an endless order, shuffled anew for every round, that depends on the seed alone; iteration n sees
// images ⌊n/4⌋ … ⌊n/4⌋ + window − 1 of it. So a run that goes on from a checkpoint sees what it would have seen. The
// next images are decoded by threads of their own while the window is trained on.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <vector>

#include "core/base/torch.h"
#include "core/scene/camera.h"

namespace fieldgraft {

// Pixels H×W×C uint8, C = 3 or 4 (straight alpha), sRGB values, one image a camera; masks H×W bool, false = ignore,
// undefined = no mask.
struct ImageSet {
    std::vector<Camera> cameras;
    std::vector<Tensor> pixels;
    std::vector<Tensor> masks;
};

// Throws InputError unless image i has its camera's size.
void check_image(const ImageSet& set, std::size_t i);

class ImageStream {
  public:
    struct Image {
        Tensor pixels, mask;
    };
    // By number among the cameras; called from several threads. What it gives is the stream's to keep and to write
    // into.
    using Load = std::function<Image(std::size_t)>;

    // 1 ≤ window ≤ the number of cameras.
    ImageStream(std::vector<Camera> cameras, Load load, std::size_t window, std::uint64_t seed);

    // The images of that iteration, until the next call. Going on is cheap; going back loads the window again. Throws
    // what `load` throws, and InputError for an image that does not fit its camera, or masks that leave no pixel.
    const ImageSet& at(std::int64_t iteration);

    std::size_t size() const { return cameras_.size(); }
    std::size_t window() const { return window_; }
    // The image at place j of the endless order.
    std::size_t image_at(std::int64_t j);

  private:
    static constexpr std::int64_t iterations_an_image = 4;
    static constexpr std::size_t images_ahead = 2;

    void fill(std::int64_t first);
    Image take(std::int64_t j);
    void put(std::int64_t j, Image image);
    std::future<Image> start_loading(std::int64_t j);
    void check_usable() const;

    std::vector<Camera> cameras_;
    Load load_;
    std::size_t window_;
    std::uint64_t seed_;
    ImageSet shown_;
    std::vector<bool> usable_;  // of the window's places: some pixel is not masked
    std::int64_t first_ = -1;   // of the window, in the endless order
    struct Ahead {
        std::int64_t j;
        std::future<Image> image;
    };
    std::deque<Ahead> ahead_;
    std::int64_t round_ = -1;  // whose order `order_` is
    std::vector<std::size_t> order_;
};

}  // namespace fieldgraft
