#include <gtest/gtest.h>

#include "core/render/render_view.h"
#include "core/train/occupancy_grid.h"
#include "tests/base/one_thread.h"
#include "tests/train/ball_scene.h"

namespace fieldgraft {
namespace {

using testing::ball_data;
using testing::small_options;

// Colours as bytes, row after row, of one shade with a patch of another in the middle.
Tensor patch_on(std::int64_t shade, std::int64_t patch) {
    Tensor image = at::full({20, 30, 3}, shade, at::kByte);
    image.slice(0, 6, 14).slice(1, 8, 22).fill_(patch);
    return image;
}

TEST(PlainBackground, IsTheColourAllAroundTheEdges) {
    const PlainBackground found = plain_background({patch_on(230, 10), patch_on(233, 90)});
    ASSERT_TRUE(found);
    EXPECT_NEAR((*found)[0], 230 / 255.0, 4 / 255.0);
    EXPECT_FALSE(plain_background({patch_on(230, 10), patch_on(120, 10)})) << "two rooms";
    Tensor cut = patch_on(230, 10);
    cut.slice(0, 14, 20).fill_(10);  // a floor along the lower edge
    EXPECT_FALSE(plain_background({cut}));
    const Tensor alpha = at::cat({patch_on(230, 10), at::full({20, 30, 1}, 255, at::kByte)}, 2);
    EXPECT_FALSE(plain_background({alpha}));
    EXPECT_FALSE(plain_background({}));
}

// The ball before a colour, as cameras without alpha take it, and the cameras inside the box.
TrainingData ball_in_a_studio(const std::array<float, 3>& behind) {
    TrainingData data = ball_data();
    data.geometry.box_min = {-3.5, -3.5, -3.5};
    data.geometry.box_max = {3.5, 3.5, 3.5};
    data.geometry.radius_range = {3, 3.2};
    for (ImageSet* set : {&data.train, &data.validation}) {
        for (Tensor& pixels : set->pixels) {
            const Tensor values = pixels.to(at::kFloat) / 255, alpha = values.narrow(2, 3, 1);
            const Tensor color = torch::tensor({behind[0], behind[1], behind[2]});
            pixels = ((values.narrow(2, 0, 3) * alpha + (1 - alpha) * color) * 255).round().to(at::kByte);
        }
    }
    data.background = plain_background(data.train.pixels);
    for (int c = 0; c < 3; ++c) data.geometry.background[c] = behind[c];
    return data;
}

class Studio : public OneThread {
  protected:
    TrainOptions options_ = small_options(500);
    Studio() {
        options_.step = 0.08;
        options_.field->finest_resolution = 96;
        options_.field->log2_table_size = 13;
    }
};

TEST_F(Studio, EmptySpaceStaysEmpty) {
    TrainingData data = ball_in_a_studio({0.95f, 0.9f, 0.8f});
    ASSERT_TRUE(data.background);
    const TrainResult result = train_field(data, options_);
    EXPECT_GT(result.report.psnr, 24);
    // From a camera's place to the ball nothing is in the way, and beside it there is nothing at all.
    const Tensor eye = torch::tensor({{3.0f, 0.0f, -0.6f}, {3.0f, 0.0f, -0.6f}});
    Tensor ways = torch::tensor({{0.0f, 0.0f, 0.0f}, {0.0f, 1.0f, 0.0f}}) - eye;
    ways = ways / ways.norm(2, 1, true);
    const RenderedRays drawn = render_rays(*result.field, {eye, ways});
    EXPECT_GT(drawn.alpha[0].item<double>(), 0.9);
    EXPECT_LT(drawn.alpha[1].item<double>(), 0.1);
    EXPECT_NEAR(drawn.depth[0].item<double>(), std::sqrt(9.36) - 0.6, 0.2);
}

TEST_F(Studio, CellsThatNoCameraSeesAreNeverOccupied) {
    const TrainingData data = ball_in_a_studio({1, 1, 1});
    const Tensor seen = seen_cells(data.geometry, 64, data.train.cameras, data.near());
    const double share = seen.to(at::kFloat).mean().item<double>();
    EXPECT_GT(share, 0.2);
    EXPECT_LT(share, 0.99);
    EXPECT_TRUE(seen[32][32][32].item<bool>());   // the ball
    EXPECT_FALSE(seen[0][32][32].item<bool>());   // far below the pictures' lower edges
    EXPECT_FALSE(seen[63][32][32].item<bool>());  // and above the upper ones
    options_.occupancy_resolution = 64;
    const TrainResult result = train_field(data, options_);
    const Tensor occupied = result.field->occupancy().to(at::kBool);
    EXPECT_FALSE(occupied.logical_and(seen.logical_not()).any().item<bool>());
}

TEST(SeenCells, OfOneCameraAreACone) {
    FieldGeometry geometry;  // ±1.5
    const Camera camera = camera_from_angle(64, 64, 0.4, look_at({-1.4, 0, 0}, {1, 0, 0}, {0, 0, 1}));
    const Tensor seen = seen_cells(geometry, 48, {camera}, 0.5);
    const auto at = [&](double x, double y, double z) {
        const auto cell = [](double v) { return static_cast<std::int64_t>((v + 1.5) / 3 * 48); };
        return seen[cell(z)][cell(y)][cell(x)].item<bool>();
    };
    EXPECT_TRUE(at(0, 0, 0));
    EXPECT_TRUE(at(1.45, 0.5, 0.5));  // tan(0.2) · 2.85 = 0.58
    EXPECT_FALSE(at(1.45, 1.3, 0));
    EXPECT_FALSE(at(-0.9, 1.0, 0));
    EXPECT_FALSE(at(-1.3, 0, 0)) << "nearer than `near`";
    EXPECT_FALSE(seen_cells(geometry, 48, {}, 0).any().item<bool>());
}

}  // namespace
}  // namespace fieldgraft
