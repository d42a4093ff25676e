#include "core/base/image.h"

#include <gtest/gtest.h>

#include <array>

#include "core/base/errors.h"
#include "core/base/files.h"
#include "core/base/random.h"
#include "tests/base/temp_folder.h"

namespace fieldgraft {
namespace {

// Values on the 8-bit grid, so that a PNG round trip must be exact.
Tensor noise(int height, int width, int channels, std::uint64_t seed = 1) {
    Random random(seed);
    Tensor image = at::empty({height, width, channels}, at::kFloat);
    float* out = image.data_ptr<float>();
    for (std::int64_t i = 0; i < image.numel(); ++i) out[i] = static_cast<float>(random.below(256)) / 255.0f;
    return image;
}

TEST(Png, RoundTripIsExactAndGreyBecomesRgb) {
    const TempFolder folder;
    for (const auto& [height, width] : {std::pair{1, 1}, {3, 5}, {17, 16}}) {
        for (const int channels : {3, 4}) {
            const Tensor image = noise(height, width, channels);
            write_png(folder / "a.png", image);
            EXPECT_TRUE(read_image(folder / "a.png").equal(image));
            EXPECT_EQ(image_size(folder / "a.png"), (std::array<int, 3>{height, width, channels}));
        }
    }
    const Tensor grey = noise(4, 3, 1).squeeze(2);
    write_png(folder / "grey.png", grey);
    EXPECT_TRUE(read_image(folder / "grey.png").equal(grey.unsqueeze(2).expand({4, 3, 3})));
}

TEST(Png, ClampsRoundsAndRefusesNan) {
    const TempFolder folder;
    Tensor image = at::full({1, 4, 3}, 0.0f);
    image[0][0].fill_(-1);
    image[0][1].fill_(7);
    image[0][2].fill_(127.4f / 255);
    image[0][3].fill_(127.6f / 255);
    write_png(folder / "a.png", image);
    const Tensor levels = (read_image(folder / "a.png").select(2, 0) * 255).round();
    EXPECT_TRUE(levels.equal(at::tensor({0.0f, 255.0f, 127.0f, 128.0f}).reshape({1, 4})));
    image[0][0][0] = std::nanf("");
    EXPECT_THROW(write_png(folder / "b.png", image), std::invalid_argument);
    EXPECT_THROW(write_png(folder / "b.png", at::zeros({2, 2, 2})), std::invalid_argument);
    EXPECT_THROW(write_png(folder / "b.png", at::zeros({0, 2, 3})), std::invalid_argument);
    EXPECT_FALSE(std::filesystem::exists(folder / "b.png"));
}

TEST(Exr, RoundTripIsExactOutsideTheUnitRangeToo) {
    const TempFolder folder;
    for (const int channels : {3, 4}) {
        const Tensor image = noise(5, 7, channels) * 1000 - 300;
        write_exr(folder / "a.exr", image);
        EXPECT_TRUE(read_image(folder / "a.exr").equal(image));
        EXPECT_EQ(image_size(folder / "a.exr"), (std::array<int, 3>{5, 7, channels}));
    }
    const Tensor plane = noise(2, 3, 1).squeeze(2);
    write_exr(folder / "y.exr", plane);
    EXPECT_TRUE(read_image(folder / "y.exr").equal(plane.unsqueeze(2).expand({2, 3, 3})));
}

TEST(GoldenImages, SixteenBitPalettesAndJpeg) {
    const std::string golden = std::string(FIELDGRAFT_SOURCE_DIR) + "/tests/golden/images/";
    const Tensor deep = read_image(golden + "grey16.png");
    ASSERT_EQ(deep.sizes(), at::IntArrayRef({2, 2, 3}));
    EXPECT_FLOAT_EQ(deep[0][1][0].item<float>(), 258.0f / 65535.0f);
    EXPECT_FLOAT_EQ(deep[1][1][2].item<float>(), 1.0f);
    const Tensor palette = read_image(golden + "palette.png");
    ASSERT_EQ(palette.sizes(), at::IntArrayRef({2, 2, 4}));
    EXPECT_TRUE((palette * 255)
                    .round()
                    .equal(at::tensor({255.0f, 0.0f, 0.0f, 255.0f, 0.0f, 255.0f, 0.0f, 128.0f, 0.0f, 0.0f, 255.0f, 0.0f,
                                       255.0f, 0.0f, 0.0f, 255.0f})
                               .reshape({2, 2, 4})));
    EXPECT_EQ(image_size(golden + "palette.png"), (std::array<int, 3>{2, 2, 4}));
    const Tensor jpeg = read_image(golden + "ramp.jpg");
    ASSERT_EQ(jpeg.sizes(), at::IntArrayRef({16, 24, 3}));
    EXPECT_EQ(image_size(golden + "ramp.jpg"), (std::array<int, 3>{16, 24, 3}));
    const Tensor ramp = at::arange(24, at::kFloat).div(23).view({1, 24, 1}).expand({16, 24, 3});
    EXPECT_LT((jpeg - ramp).abs().max().item<float>(), 0.02f);
}

TEST(BrokenImages, TruncatedMissingAndForeignFilesAreInputErrors) {
    const TempFolder folder;
    const std::string golden = std::string(FIELDGRAFT_SOURCE_DIR) + "/tests/golden/images/";
    write_png(folder / "a.png", noise(32, 32, 4));
    write_exr(folder / "a.exr", noise(32, 32, 4));
    for (const std::string& source : {(folder / "a.png").string(), (folder / "a.exr").string(), golden + "ramp.jpg"}) {
        const std::string bytes = read_file(source);
        for (const double share : {0.1, 0.3, 0.6, 0.9, 0.99}) {
            write_file(folder / "cut",
                       bytes.substr(0, static_cast<std::size_t>(share * static_cast<double>(bytes.size()))));
            EXPECT_CONTAINS(message_of<InputError>([&] { read_image(folder / "cut"); }), "cut") << source << share;
        }
    }
    EXPECT_CONTAINS(message_of<InputError>([&] { read_image(folder / "none.png"); }), "No such file");
    EXPECT_CONTAINS(message_of<InputError>([&] { read_image(folder.path()); }), "folder");
    write_file(folder / "text.png", "hello, I am text");
    EXPECT_CONTAINS(message_of<InputError>([&] { read_image(folder / "text.png"); }), "not an image");
    write_file(folder / "empty.png", "");
    EXPECT_CONTAINS(message_of<InputError>([&] { image_size(folder / "empty.png"); }), "empty file");
    // One flipped byte in the middle of the pixel data breaks the checksum.
    std::string bytes = read_file(folder / "a.png");
    bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 0x10);
    write_file(folder / "flip.png", bytes);
    EXPECT_CONTAINS(message_of<InputError>([&] { read_image(folder / "flip.png"); }), "damaged");
}

TEST(Compose, OverBackground) {
    const Tensor image = at::tensor({0.2f, 0.4f, 0.6f, 0.25f}).view({1, 1, 4});
    const Tensor result = over_background(image, at::ones({3}));
    EXPECT_TRUE(at::allclose(result, at::tensor({0.8f, 0.85f, 0.9f}).view({1, 1, 3})));
    const Tensor rgb = noise(2, 2, 3);
    EXPECT_TRUE(over_background(rgb, at::zeros({3})).equal(rgb));
    EXPECT_THROW(over_background(noise(2, 2, 2), at::zeros({3})), std::invalid_argument);
    EXPECT_THROW(over_background(image, at::zeros({4})), std::invalid_argument);
}

TEST(Resize, AveragesAreas) {
    const Tensor image = noise(6, 8, 3);
    const Tensor half = resize_image(image, 3, 4);
    const Tensor blocks = image.view({3, 2, 4, 2, 3}).mean(3).mean(1);
    EXPECT_TRUE(at::allclose(half, blocks, 1e-5, 1e-6));
    // 3 → 2: weights (1, ½)/1.5 and (½, 1)/1.5.
    const Tensor line = at::tensor({0.0f, 0.3f, 0.9f}).view({1, 3, 1});
    EXPECT_TRUE(at::allclose(resize_image(line, 1, 2).flatten(), at::tensor({0.1f, 0.7f})));
    EXPECT_TRUE(resize_image(image, 6, 8).equal(image));
    EXPECT_TRUE(at::allclose(resize_image(at::ones({5, 7, 3}), 13, 3), at::ones({13, 3, 3})));
    EXPECT_TRUE(at::allclose(resize_image(at::ones({1, 1, 3}), 4, 4), at::ones({4, 4, 3})));
    // Growing is linear between centres.
    const Tensor grown = resize_image(at::tensor({0.0f, 1.0f}).view({1, 2, 1}), 1, 4).flatten();
    EXPECT_TRUE(at::allclose(grown, at::tensor({0.0f, 0.25f, 0.75f, 1.0f})));
    EXPECT_THROW(resize_image(image, 0, 4), std::invalid_argument);
}

TEST(Resize, TransparentColoursDoNotBleed) {
    Tensor image = at::zeros({2, 2, 4});
    image[0][0] = at::tensor({1.0f, 0.5f, 0.25f, 1.0f});  // one opaque pixel, three transparent black ones
    const Tensor pixel = resize_image(image, 1, 1).flatten();
    EXPECT_TRUE(at::allclose(pixel, at::tensor({1.0f, 0.5f, 0.25f, 0.25f})));
    EXPECT_TRUE(resize_image(at::zeros({2, 2, 4}), 1, 1).equal(at::zeros({1, 1, 4})));
}

}  // namespace
}  // namespace fieldgraft
