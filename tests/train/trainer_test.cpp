#include "core/train/trainer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "core/base/errors.h"
#include "core/base/files.h"
#include "core/base/safetensors.h"
#include "core/render/image_metrics.h"
#include "core/train/checkpoint.h"
#include "core/train/field_optimizer.h"
#include "tests/base/one_thread.h"
#include "tests/train/ball_scene.h"

namespace fieldgraft {
namespace {

namespace fs = std::filesystem;
using testing::ball_data;
using testing::small_options;

fs::path temporary(const std::string& name) {
    const fs::path folder = fs::path(::testing::TempDir()) / "fieldgraft_train";
    fs::create_directories(folder);
    fs::remove(folder / name);
    return folder / name;
}

using Train = OneThread;

TEST_F(Train, LearnsABall) {
    std::vector<Json> events;
    const Reporter reporter([&](const Json& event) { events.push_back(event); });
    const TrainResult result = train_field(ball_data(), small_options(400), reporter);
    EXPECT_GT(result.report.psnr, 24) << "PSNR of a view that was not trained on";
    EXPECT_EQ(result.report.iterations, 400);
    EXPECT_EQ(result.report.skipped, 0);
    EXPECT_GT(result.report.peak_mib, 1);
    const double share = result.field->occupancy().to(at::kFloat).mean().item<double>();
    EXPECT_LT(share, 0.5);
    EXPECT_GT(share, 0.005);
    ASSERT_FALSE(events.empty());
    EXPECT_EQ(events.back()["event"], "progress");
    EXPECT_EQ(events.back()["iteration"], 400);
    EXPECT_EQ(events.back()["total"], 400);
    EXPECT_GE(events.back()["eta_s"].get<double>(), 0);
}

TEST_F(Train, PrecisionOfTheNetworksIsAChoiceAndHardlyShows) {
    auto options = small_options(300);
    options.precision = "float32";
    const TrainResult single = train_field(ball_data(), options);
    EXPECT_EQ(single.report.precision, "float32");
    options.precision = "bfloat16";
    const TrainResult half = train_field(ball_data(), options);
    if (half.report.precision != "bfloat16") GTEST_SKIP() << "this machine has no AMX tiles";
    EXPECT_NE(half.field->hash(), single.field->hash());
    EXPECT_NEAR(half.report.psnr, single.report.psnr, 1.0);
}

TEST_F(Train, SameSeedSameFileBitForBit) {
    const fs::path a = temporary("a.safetensors"), b = temporary("b.safetensors");
    train_field(ball_data(), small_options(20)).field->save(a);
    train_field(ball_data(), small_options(20)).field->save(b);
    EXPECT_EQ(read_file(a), read_file(b));
    auto other = small_options(20);
    other.seed = 8;
    train_field(ball_data(), other).field->save(b);
    EXPECT_NE(read_file(a), read_file(b));
}

TEST_F(Train, TheNumberOfThreadsDoesNotMatter) {
    auto options = small_options(40);  // past two looks at the occupancy
    const std::string one = train_field(ball_data(), options).field->hash();
    at::set_num_threads(3);
    EXPECT_EQ(train_field(ball_data(), options).field->hash(), one);
}

TEST_F(Train, StoppedAndResumedItIsTheSameRun) {
    const fs::path checkpoint = temporary("checkpoint.safetensors");
    auto options = small_options(40);
    const std::string expected = train_field(ball_data(), options).field->hash();
    // Asked to stop from the start, a run does one iteration, saves and ends: four pieces, then the rest.
    const std::atomic<bool> stop{true};
    const Reporter stopping([](const Json&) {}, &stop);
    for (int piece = 0; piece < 4; ++piece) {
        EXPECT_THROW(train_field(ball_data(), options, stopping, checkpoint, piece > 0), Cancelled);
        ASSERT_TRUE(fs::exists(checkpoint));
    }
    const TrainResult result = train_field(ball_data(), options, {}, checkpoint, true);
    EXPECT_EQ(result.field->hash(), expected);
    EXPECT_EQ(result.report.iterations, 40);
}

// The same images, two of them in memory at a time.
TrainingData streamed_ball() {
    TrainingData data = ball_data();
    const auto images = std::make_shared<ImageSet>(std::move(data.train));
    data.train = {images->cameras, {}, {}};
    const auto load = [images](std::size_t i) {
        return ImageStream::Image{images->pixels[i].clone(), images->masks[i]};
    };
    data.stream = std::make_shared<ImageStream>(images->cameras, load, 2, 7);
    return data;
}

TEST_F(Train, StreamedImagesTeachTheSameBall) {
    const TrainResult result = train_field(streamed_ball(), small_options(400));
    EXPECT_GT(result.report.psnr, 23) << "PSNR of a view that was not trained on";
}

TEST_F(Train, StreamedImagesAreTheSameAfterAStop) {
    const fs::path checkpoint = temporary("streamed.safetensors");
    const auto options = small_options(40);
    const std::string expected = train_field(streamed_ball(), options).field->hash();
    EXPECT_NE(expected, train_field(ball_data(), options).field->hash());
    const std::atomic<bool> stop{true};
    const Reporter stopping([](const Json&) {}, &stop);
    for (int piece = 0; piece < 9; ++piece) {
        EXPECT_THROW(train_field(streamed_ball(), options, stopping, checkpoint, piece > 0), Cancelled);
    }
    EXPECT_EQ(train_field(streamed_ball(), options, {}, checkpoint, true).field->hash(), expected);
}

TEST_F(Train, ImagesBeyondTheMemoryAreStreamed) {
    const TrainingData all = ball_data();
    std::vector<Tensor> images;
    for (const Tensor& pixels : all.train.pixels) images.push_back(pixels.to(at::kFloat) / 255);
    const Scene scene = Scene::from_images(all.train.cameras, images);
    const std::int64_t image = 24 * 24 * 4;
    EXPECT_EQ(training_data_of(scene).stream, nullptr);
    EXPECT_EQ(training_data_of(scene, 8 * image).stream, nullptr);
    const TrainingData some = training_data_of(scene, 8 * image - 1);
    ASSERT_NE(some.stream, nullptr);
    EXPECT_EQ(some.stream->window(), 7u);
    EXPECT_EQ(training_data_of(scene, 1).stream->window(), 1u);
    const ImageSet& shown = some.images_at(0);
    ASSERT_EQ(shown.pixels.size(), 7u);
    EXPECT_TRUE(at::equal(shown.pixels[0], scene.pixels(scene.views()[some.stream->image_at(0)])));
    auto options = small_options(20);
    options.image_bytes = 3 * image;
    std::vector<Json> events;
    const Reporter reporter([&](const Json& event) { events.push_back(event); });
    train_field(scene, options, reporter);
    EXPECT_EQ(events.front().at("event"), "warning");
    EXPECT_NE(events.front().at("message").get<std::string>().find("3 at a time"), std::string::npos);
}

TEST_F(Train, ACheckpointOfAnotherRunIsRefused) {
    const fs::path checkpoint = temporary("other.safetensors");
    train_field(ball_data(), small_options(2), {}, checkpoint);
    auto options = small_options(2);
    options.seed = 1;
    try {
        train_field(ball_data(), options, {}, checkpoint, true);
        FAIL() << "it was taken";
    } catch (const InputError& error) {
        EXPECT_NE(std::string(error.what()).find("seed"), std::string::npos) << error.what();
    }
    write_file(checkpoint, read_file(checkpoint).substr(0, 200));
    EXPECT_THROW(train_field(ball_data(), small_options(2), {}, checkpoint, true), InputError);
    EXPECT_THROW(train_field(ball_data(), small_options(2), {}, temporary("absent.safetensors"), true), InputError);
}

TEST_F(Train, ALongerBudgetMayGoOnWithTheFieldOfAShorterOne) {
    const fs::path checkpoint = temporary("budget.safetensors");
    TrainOptions options = small_options(1);
    options.iterations.reset();
    options.minutes = 1;
    options.field.reset();
    const std::atomic<bool> stop{true};
    EXPECT_THROW(train_field(ball_data(), options, Reporter([](const Json&) {}, &stop), checkpoint), Cancelled);
    options.minutes = 5;
    EXPECT_GT(options.field_config().log2_table_size, 16) << "by itself it would take a larger table";
    EXPECT_THROW(train_field(ball_data(), options, Reporter([](const Json&) {}, &stop), checkpoint, true), Cancelled);
}

TEST_F(Train, TimeIsKept) {
    auto options = small_options(1);
    options.iterations.reset();
    options.minutes = 0.02;
    const TrainResult result = train_field(ball_data(), options);
    EXPECT_GE(result.report.seconds, 1.2);
    EXPECT_LT(result.report.seconds, 6);
}

TEST_F(Train, ImagesWithoutAlphaAndMasksAreFine) {
    TrainingData data = ball_data();
    for (Tensor& pixels : data.train.pixels) pixels = pixels.narrow(2, 0, 3).contiguous();
    data.train.masks[0] = at::zeros({24, 24}, at::kBool);
    data.validation = {};
    const TrainResult result = train_field(data, small_options(20));
    EXPECT_TRUE(std::isfinite(result.report.psnr));
}

TEST_F(Train, BadInputIsNamed) {
    TrainingData data = ball_data();
    EXPECT_THROW(train_field(TrainingData{}, small_options(1)), InputError);
    data.train.pixels[2] = at::zeros({24, 23, 4}, at::kByte);
    EXPECT_THROW(train_field(data, small_options(1)), InputError);
    data = ball_data();
    for (Tensor& mask : data.train.masks) mask = at::zeros({24, 24}, at::kBool);
    EXPECT_THROW(train_field(data, small_options(1)), InputError);
    for (const auto& change : std::vector<std::function<void(TrainOptions&)>>{
             [](TrainOptions& o) { o.iterations = 0; }, [](TrainOptions& o) { o.minutes = 1; },
             [](TrainOptions& o) { o.quality = "best"; }, [](TrainOptions& o) { o.precision = "half"; },
             [](TrainOptions& o) { o.samples = 1; }, [](TrainOptions& o) { o.rate = NAN; },
             [](TrainOptions& o) { o.rate_end = 0; }, [](TrainOptions& o) { o.step = -1; },
             [](TrainOptions& o) { o.occupancy_resolution = 0; }}) {
        auto options = small_options(1);
        change(options);
        EXPECT_THROW(train_field(ball_data(), options), InputError);
    }
}

TEST_F(Train, NonFiniteGradientsChangeNothing) {
    auto options = small_options(1);
    RadianceField field(options.field_config(), {}, 1);
    FieldOptimizer optimizer(field);
    const std::string before = field.hash();
    std::vector<RangeFit> fits;
    for (int i = 0; i < 2; ++i) fits.emplace_back(field.mlp_shape());
    const auto refused = [&] {
        EXPECT_FALSE(optimizer.step(field, 0.01, fits));
        EXPECT_EQ(field.hash(), before);
        EXPECT_EQ(optimizer.steps(), 0);
    };
    fits[1].gradients.color1[3] = NAN;
    refused();
    fits[1].gradients.color1[3] = 1;
    fits[0].finite = false;
    refused();
    fits[0].finite = true;
    fits[1].squared_error = INFINITY;
    refused();
    fits[1].squared_error = 0;
    EXPECT_TRUE(optimizer.step(field, 0.01, fits));
    EXPECT_EQ(optimizer.steps(), 1);
    EXPECT_NE(field.hash(), before);
}

TEST_F(Train, ACheckpointThatIsNotFiniteIsRefused) {
    const fs::path checkpoint = temporary("diverged.safetensors");
    const std::atomic<bool> stop{true};
    EXPECT_THROW(train_field(ball_data(), small_options(60), Reporter([](const Json&) {}, &stop), checkpoint),
                 Cancelled);
    SafeTensors saved = load_safetensors(checkpoint);
    saved.tensors.at("p.color.1").fill_(NAN);
    save_safetensors(checkpoint, saved.tensors, saved.metadata);
    try {
        train_field(ball_data(), small_options(60), {}, checkpoint, true);
        FAIL() << "NaN parameters went unnoticed";
    } catch (const InputError& error) {
        EXPECT_NE(std::string(error.what()).find("p.color.1"), std::string::npos) << error.what();
    }
}

TEST_F(Train, RandomRaysAreUniformOverThePixels) {
    const TrainingData data = ball_data();
    Random random(3);
    const RayBatch batch = draw_rays(data.train, 20000, random);
    EXPECT_EQ(batch.colors.sizes(), (std::vector<std::int64_t>{20000, 4}));
    EXPECT_TRUE(at::allclose(batch.rays.directions.norm(2, 1), at::ones({20000}), 0, 1e-6));
    double covered = 0;
    for (const Tensor& pixels : data.train.pixels)
        covered += pixels.select(2, 3).to(at::kFloat).mean().item<double>() / 255;
    const double expected = covered / static_cast<double>(data.train.pixels.size());
    const double sigma = std::sqrt(expected * (1 - expected) / 20000);
    EXPECT_NEAR(batch.colors.select(1, 3).mean().item<double>(), expected, 4 * sigma);
}

TEST_F(Train, OccupancyFindsTheDenseCells) {
    auto options = small_options(1);
    RadianceField field(options.field_config(), {}, 1);
    OccupancyGrid grid({}, 16, 0.04);
    EXPECT_EQ(grid.share(), 1);  // nothing is known to be empty
    Random random(1);
    grid.refresh_all(field, random);
    EXPECT_EQ(grid.share(), 1);  // an untrained field is nearly the same everywhere
    {
        at::NoGradGuard no_grad;
        Tensor table = field.parameters().at("encoding.table"), last = field.parameters().at("density.1");
        table.copy_(at::sin(at::arange(table.numel(), at::kFloat)).view_as(table));
        last[0].mul_(8);
    }
    grid = OccupancyGrid({}, 16, 0.04);
    grid.refresh_all(field, random);
    EXPECT_LT(grid.share(), 0.95);
    EXPECT_GT(grid.share(), 0.1);
    const Tensor before = grid.values().clone();
    grid.refresh_some(field, random);
    const Tensor changed = grid.values().ne(before);
    EXPECT_GT(changed.sum().item<std::int64_t>(), 16 * 16 * 16 / 32 / 4);
    EXPECT_LT(changed.sum().item<std::int64_t>(), 16 * 16 * 16 / 8);
}

}  // namespace
}  // namespace fieldgraft
