// Nothing that is not finite gets into a file, and nothing of the kind is read from one; what f's density makes of hard
// numbers.
#include <gtest/gtest.h>

#include "core/base/errors.h"
#include "core/base/files.h"
#include "core/base/safetensors.h"
#include "core/edit/edit_state.h"
#include "core/field/kernel_field.h"
#include "core/train/checkpoint.h"
#include "tests/base/temp_folder.h"
#include "tests/render/edit_fixtures.h"
#include "tests/stability/big.h"
#include "tests/stability/ledger.h"

namespace fieldgraft::stability {
namespace {

namespace fs = std::filesystem;

std::string refusal(const std::function<void()>& write) {
    try {
        write();
    } catch (const Failure& error) {
        return error.what();
    }
    return "it was written";
}

const std::vector<float>& not_numbers() {
    static const std::vector<float> bad{NAN, INFINITY, -INFINITY};
    return bad;
}

TEST(Files, AFieldThatIsNotFiniteIsNotWritten) {
    const TempFolder folder;
    const fs::path path = folder.path() / "field.safetensors";
    for (const float bad : not_numbers()) {
        const auto field = ball_field();
        field->save(path);
        const std::string before = read_file(path);
        field->parameters().at("color.1")[2][3].fill_(bad);
        const std::string message = refusal([&] { field->save(path); });
        EXPECT_NE(message.find("color.1"), std::string::npos) << message;
        EXPECT_EQ(read_file(path), before) << "the file that was there is as it was";
    }
}

TEST(Files, AnEditThatIsNotFiniteIsNotWritten) {
    const TempFolder folder;
    const fs::path path = folder.path() / "edit.safetensors";
    for (const float bad : not_numbers()) {
        EditFile file;
        file.field = ball_edit("add,remove,change", {0, 0, 0}, 0.5f);
        {
            at::NoGradGuard no_grad;
            Tensor(file.field->parameters().at("grid.table"))[1][1].fill_(bad);
        }
        const std::string message = refusal([&] { file.save(path); });
        EXPECT_NE(message.find("grid.table"), std::string::npos) << message;
        EXPECT_FALSE(fs::exists(path));
    }
}

TEST(Files, ACheckpointThatIsNotFiniteIsNotWritten) {
    const TempFolder folder;
    const fs::path path = folder.path() / "checkpoint.safetensors";
    const auto field = ball_field();
    TrainState state{field, FieldOptimizer(*field), OccupancyGrid({}, 8, 0.1), Random(1)};
    save_checkpoint(path, state, {});
    const std::string before = read_file(path);
    field->parameters().at("density.1")[0][0].fill_(NAN);
    EXPECT_NE(refusal([&] { save_checkpoint(path, state, {}); }).find("density.1"), std::string::npos);
    EXPECT_EQ(read_file(path), before);
}

// Numbers too small for float32's usual form are numbers like any other, in files and in pictures.
TEST(Files, DenormalsAreKept) {
    const TempFolder folder;
    const fs::path path = folder.path() / "field.safetensors";
    const auto field = ball_field();
    field->parameters().at("color.2").fill_(1e-42f);
    field->save(path);
    const auto loaded = RadianceField::load(path);
    EXPECT_EQ(loaded->parameters().at("color.2")[1][1].item<float>(), 1e-42f);
    const RenderedRays drawn = render_rays(*loaded, front_rays(8));
    EXPECT_TRUE(at::isfinite(drawn.color).all().item<bool>());
}

// Sums of large finite numbers overflow no check.
TEST(Files, LargeNumbersAreNotTakenForInfinities) {
    EXPECT_EQ(not_finite({{"x", at::full({100}, 3e38)}, {"y", at::full({2}, 1.7e308, at::kDouble)}}), "");
    EXPECT_EQ(not_finite({{"x", at::tensor({INFINITY, -INFINITY})}}), "x");
}

// What the blended rays make of numbers that are none: NaN where a ray has one (a step with it is left out), never a
// number that looks right; infinities of density are opaque.
TEST(NotNumbers, InABlendAreSeenInTheirRayAlone) {
    const auto rays = [](float bad) {
        const Tensor density = at::ones({4});
        density[2].fill_(bad);
        return density;
    };
    const Tensor start = at::tensor({0, 2, 4}, at::kLong), ones = at::ones({4}), color = at::full({4, 3}, 0.5);
    EditSamples edit;
    edit.density_e = rays(NAN);
    edit.color_e = color;
    const BlendOut hurt = blend(start, ones, ones, color, edit, {});
    EXPECT_TRUE(std::isnan(hurt.color[1][0].item<float>()));
    EXPECT_TRUE(std::isfinite(hurt.color[0][0].item<float>()));
    edit.density_e = rays(INFINITY);
    const BlendOut opaque = blend(start, ones, ones, color, edit, {});
    EXPECT_TRUE(at::isfinite(opaque.color).all().item<bool>());
    EXPECT_EQ(opaque.transmittance[1].item<float>(), 0);
    const CompositeOut plain = composite(start, ones, ones, rays(NAN), color);
    EXPECT_TRUE(std::isfinite(plain.color[0][0].item<float>()));
    EXPECT_TRUE(std::isnan(plain.color[1][0].item<float>())) << "a NaN density is hidden";
}

// A field that is the same everywhere, of log density z + its offset.
RadianceField constant_field(float z) {
    HashFieldConfig config;
    config.levels = 1;
    config.features_per_level = 2;
    config.log2_table_size = 6;
    config.base_resolution = config.finest_resolution = 2;
    config.density_hidden = 1;
    RadianceField field(config, {}, 1);
    at::NoGradGuard no_grad;
    field.parameters().at("encoding.table").fill_(1);
    field.parameters().at("density.0").fill_(0.5);
    field.parameters().at("density.1").fill_(z);
    return field;
}

TEST(DensityOfF, ValueAndGradient) {
    const Tensor middle = at::zeros({1, 3});
    for (const float z :
         {-120.0f, -87.0f, -20.0f, -1.0f, -1e-6f, 0.0f, 1e-6f, 1.0f, 10.0f, 15.9f, 16.1f, 100.0f, 1e30f}) {
        const RadianceField field = constant_field(z);
        const Tensor density = field.density(middle).density;
        const Tensor weight = field.parameters().at("density.1");
        const Tensor slope = torch::autograd::grad({density.sum()}, {weight})[0][0][0];
        // Held at the limit; the gradient stays what it is there, so that a density can come back from it.
        const Big right = boost::multiprecision::exp(Big(std::min<double>(z + log_density_offset, log_density_limit)));
        const std::string input = z < -20 ? "z < −20" : z > 16 ? "held: z > 16" : "z within ±20";
        const Big unit = right * (1 + std::min(std::abs(z), 120.0f));
        const float naive = std::exp(z - 1);
        ledger().add("density of f, exp", "value", "torch", input,
                     error_of(density.item<float>(), right, unit, smallest), error_of(naive, right, unit, smallest));
        ledger().add("density of f, exp", "gradient", "torch", input,
                     error_of(slope.item<float>(), right, unit, smallest), error_of(naive, right, unit, smallest));
    }
}

}  // namespace
}  // namespace fieldgraft::stability
