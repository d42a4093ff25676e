#include "core/train/image_stream.h"

#include <gtest/gtest.h>

#include <atomic>
#include <set>

#include "core/base/errors.h"

namespace fieldgraft {
namespace {

constexpr int count = 10;

std::vector<Camera> cameras() {
    std::vector<Camera> all;
    for (int i = 0; i < count; ++i) all.push_back(camera_from_angle(4, 3, 0.7, identity4, fmt::format("r_{}", i)));
    return all;
}

// Image i is of the value i everywhere; `loads` counts how often each was asked for.
struct Counted {
    std::array<std::atomic<int>, count> loads{};
    ImageStream::Load load() {
        return [this](std::size_t i) {
            ++loads[i];
            return ImageStream::Image{at::full({3, 4, 3}, static_cast<std::int64_t>(i), at::kByte), {}};
        };
    }
};

// The numbers of the images in a window, and that each has its own camera.
std::multiset<int> shown(const ImageSet& set) {
    std::multiset<int> numbers;
    for (std::size_t i = 0; i < set.pixels.size(); ++i) {
        const int number = set.pixels[i][0][0][0].item<int>();
        EXPECT_EQ(set.cameras[i].name, fmt::format("r_{}", number));
        numbers.insert(number);
    }
    return numbers;
}

std::multiset<int> expected(ImageStream& stream, std::int64_t first) {
    std::multiset<int> numbers;
    for (std::size_t i = 0; i < stream.window(); ++i) {
        numbers.insert(static_cast<int>(stream.image_at(first + static_cast<std::int64_t>(i))));
    }
    return numbers;
}

TEST(ImageStream, EveryRoundIsAllImagesInAnotherOrder) {
    Counted images;
    ImageStream stream(cameras(), images.load(), 3, 5), other(cameras(), images.load(), 3, 6);
    std::vector<std::size_t> first, second, others;
    for (int j = 0; j < count; ++j) {
        first.push_back(stream.image_at(j));
        second.push_back(stream.image_at(count + j));
        others.push_back(other.image_at(j));
    }
    EXPECT_EQ(std::set<std::size_t>(first.begin(), first.end()).size(), static_cast<std::size_t>(count));
    EXPECT_EQ(std::set<std::size_t>(second.begin(), second.end()).size(), static_cast<std::size_t>(count));
    EXPECT_NE(first, second);
    EXPECT_NE(first, others);
}

TEST(ImageStream, WindowMovesByOneImageEveryFourIterations) {
    Counted images;
    {
        ImageStream stream(cameras(), images.load(), 3, 5);
        for (int iteration = 0; iteration < 100; ++iteration) {
            EXPECT_EQ(shown(stream.at(iteration)), expected(stream, iteration / 4)) << iteration;
        }
    }  // and those ahead have been waited for
    int loads = 0;
    for (const auto& n : images.loads) loads += n;
    // 3 at first, 24 more since, 2 ahead: none twice.
    EXPECT_EQ(loads, 29);
}

TEST(ImageStream, StartingAnywhereShowsTheSame) {
    Counted images;
    ImageStream on(cameras(), images.load(), 4, 5), fresh(cameras(), images.load(), 4, 5);
    for (int iteration = 0; iteration < 50; ++iteration) on.at(iteration);
    EXPECT_EQ(shown(fresh.at(49)), shown(on.at(49)));
    EXPECT_EQ(shown(on.at(3)), expected(on, 0));  // and back
}

TEST(ImageStream, AWindowOfAllIsLoadedOnce) {
    Counted images;
    ImageStream stream(cameras(), images.load(), count, 5);
    for (int iteration = 0; iteration < 60; ++iteration) EXPECT_EQ(stream.at(iteration).pixels.size(), 10u);
    for (const auto& n : images.loads) EXPECT_EQ(n, 1);
}

TEST(ImageStream, BadImagesAreNamedWhereTheyAreMet) {
    Counted images;
    const auto unreadable = [&](std::size_t i) -> ImageStream::Image {
        if (i == 7) input_error("r_7.png: not a picture");
        return images.load()(i);
    };
    ImageStream stream(cameras(), unreadable, 3, 5);
    EXPECT_THROW(
        {
            for (int iteration = 0; iteration < 4 * count; ++iteration) stream.at(iteration);
        },
        InputError);
    const auto small = [](std::size_t) { return ImageStream::Image{at::zeros({2, 4, 3}, at::kByte), {}}; };
    EXPECT_THROW(ImageStream(cameras(), small, 3, 5).at(0), InputError);
    const auto masked = [](std::size_t) {
        return ImageStream::Image{at::zeros({3, 4, 3}, at::kByte), at::zeros({3, 4}, at::kBool)};
    };
    EXPECT_THROW(ImageStream(cameras(), masked, 3, 5).at(0), InputError);
    EXPECT_THROW(ImageStream(cameras(), small, 0, 5), std::invalid_argument);
    EXPECT_THROW(ImageStream(cameras(), small, count + 1, 5), std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
