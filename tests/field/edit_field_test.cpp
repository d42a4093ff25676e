#include "core/field/edit_field.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "core/base/errors.h"
#include "core/base/files.h"
#include "core/base/random.h"
#include "core/base/safetensors.h"
#include "core/field/cells.h"
#include "core/field/edit_support.h"

namespace fieldgraft {
namespace {

EditFieldConfig small_edit_config(const std::string& operations) {
    EditFieldConfig config;
    config.operations = Operations::parse(operations);
    config.resolutions = {4, 8, 40};  // 41³ vertices in 2^12 entries: the last level is hashed
    config.log2_table_size = 12;
    config.hidden = 16;
    return config;
}

Tensor random_points(std::int64_t count, float reach = 1.5f) {
    Random random(11);
    Tensor points = at::empty({count, 3});
    for (std::int64_t i = 0; i < points.numel(); ++i) points.data_ptr<float>()[i] = random.uniform(-reach, reach);
    return points;
}

// 8×8×8, marked where x > 0.
Tensor half_support() {
    Tensor support = at::zeros({8, 8, 8}, at::kByte);
    support.slice(2, 4, 8).fill_(1);
    return support;
}

TEST(Operations, ParseAndPrint) {
    EXPECT_EQ(Operations::parse("change, add").to_string(), "change,add");
    EXPECT_EQ(Operations::parse("remove"), (Operations{false, true, false}));
    EXPECT_THROW(Operations::parse(""), InputError);
    EXPECT_THROW(Operations::parse("change,paint"), InputError);
    for (int bits = 1; bits < 8; ++bits) {
        const Operations on{(bits & 1) != 0, (bits & 2) != 0, (bits & 4) != 0};
        EXPECT_EQ(Operations::parse(on.to_string()), on);
    }
}

TEST(EditField, HasOnlyTheHeadsOfItsOperations) {
    for (const std::string operations :
         {"add", "remove", "change", "add,remove", "add,change", "remove,change", "add,remove,change"}) {
        const EditField field(small_edit_config(operations), {}, 1);
        const Operations on = Operations::parse(operations);
        EXPECT_EQ(field.parameters().contains("density_e.weight"), on.add);
        EXPECT_EQ(field.parameters().contains("color_e.weight"), on.add || on.change);
        EXPECT_EQ(field.parameters().contains("beta_density.bias"), on.remove);
        EXPECT_EQ(field.parameters().contains("beta_color.bias"), on.change);
        const EditSamples edit = field.evaluate(random_points(5));
        EXPECT_EQ(edit.operations(), on);
        EXPECT_EQ(edit.color_e.defined(), on.add || on.change);
    }
}

TEST(EditField, StartsNearTheConfiguredValues) {
    EditFieldConfig config;
    config.operations = {true, true, true};
    const EditField field(config, {}, 1);
    const EditSamples edit = field.evaluate(random_points(2000));
    EXPECT_NEAR(edit.beta_density.mean().item<double>(), 0.02, 0.004);
    EXPECT_NEAR(edit.beta_color.mean().item<double>(), 0.02, 0.004);
    EXPECT_NEAR(edit.density_e.mean().item<double>() * 3 / 128, 0.1, 0.02);
    EXPECT_NEAR(edit.color_e.mean().item<double>(), 0.5, 0.1);
    EXPECT_GT(edit.color_e.min().item<float>(), 0);
    // The gradient is live: every parameter gets one.
    (edit.density_e.sum() + edit.color_e.sum() + edit.beta_density.sum() + edit.beta_color.sum()).backward();
    for (const auto& [name, parameter] : field.parameters())
        EXPECT_GT(parameter.grad().abs().sum().item<float>(), 0) << name;
}

TEST(EditField, ExtremeParametersStayFinite) {
    EditField field(small_edit_config("add,remove,change"), {}, 1);
    for (const float scale : {1e4f, -1e10f}) {
        {
            at::NoGradGuard no_grad;
            for (const auto& [name, parameter] : field.parameters()) {
                if (name.ends_with("bias")) parameter.fill_(scale);
                if (parameter.grad().defined()) parameter.mutable_grad() = Tensor();
            }
        }
        const EditSamples edit = field.evaluate(random_points(50));
        for (const Tensor& head : {edit.density_e, edit.color_e, edit.beta_density, edit.beta_color}) {
            EXPECT_TRUE(head.isfinite().all().item<bool>());
            head.sum().backward({}, true);
        }
        for (const auto& [name, parameter] : field.parameters())
            EXPECT_TRUE(parameter.grad().isfinite().all().item<bool>()) << name;
    }
}

// The derivative along a random direction in parameter space, by the encoding's and the network's backward pass.
TEST(EditField, GradientAgainstFiniteDifferences) {
    const EditField field(small_edit_config("add,remove,change"), {}, 2);
    const Tensor points = random_points(300, 1.6f);  // some outside the box
    const auto loss = [&] {
        const EditSamples edit = field.evaluate(points);
        return (edit.density_e.mean() * 0.3 + (edit.color_e * torch::tensor({1.0f, -2.0f, 0.5f})).mean() +
                edit.beta_density.square().mean() * 40 + edit.beta_color.mean());
    };
    for (const auto& [name, parameter] : field.parameters()) {
        const Tensor direction = torch::autograd::grad({loss()}, {parameter})[0];  // steepest: the largest signal
        const double size = direction.norm().item<double>();
        ASSERT_GT(size, 0) << name;
        const double step = 1e-2 / size * std::sqrt(static_cast<double>(parameter.numel())) * 0.05;
        at::NoGradGuard no_grad;
        const Tensor before = parameter.clone();
        parameter.copy_(before + step * direction);
        const double up = loss().item<double>();
        parameter.copy_(before - step * direction);
        const double down = loss().item<double>();
        parameter.copy_(before);
        EXPECT_NEAR((up - down) / (2 * step) / (size * size), 1, 0.03) << name;
    }
}

TEST(EditField, ThreadsDoNotChangeTheEncodingsGradient) {
    const EditField field(small_edit_config("change"), {}, 2);
    const Tensor points = random_points(20000), table = field.parameters().at("grid.table");
    const int threads = at::get_num_threads();
    std::vector<Tensor> grads;
    for (const int count : {1, 2}) {
        at::set_num_threads(count);
        grads.push_back(torch::autograd::grad({field.evaluate(points).beta_color.sum()}, {table})[0]);
    }
    at::set_num_threads(threads);
    EXPECT_TRUE(at::allclose(grads[0], grads[1], 1e-5, 1e-6));
}

TEST(EditField, ZeroOutsideBoxAndSupport) {
    EditField field(small_edit_config("add,remove,change"), {}, 3);
    const Tensor points = random_points(500, 2);
    const Tensor in_box = points.abs().le(1.5).all(1);
    const EditSamples free = field.evaluate(points);
    EXPECT_TRUE(at::equal(free.beta_color.ne(0), in_box));
    field.set_support(half_support());
    const EditSamples cut = field.evaluate(points);
    const Tensor inside = in_box.logical_and(points.select(1, 0).ge(0));
    for (const auto& [now, before] : {std::pair{cut.density_e, free.density_e},
                                      {cut.beta_density, free.beta_density},
                                      {cut.beta_color, free.beta_color}}) {
        EXPECT_EQ(now.masked_select(inside.logical_not()).abs().max().item<float>(), 0);
        EXPECT_TRUE(at::allclose(now.masked_select(inside), before.masked_select(inside), 1e-6, 1e-7));
    }
    EXPECT_EQ(field.evaluate(at::empty({0, 3})).color_e.sizes(), (std::vector<std::int64_t>{0, 3}));
    EXPECT_THROW(field.evaluate(at::empty({4, 2})), std::invalid_argument);
}

TEST(EditField, LevelWeightsFadeLevels) {
    EditField field(small_edit_config("change"), {}, 4);
    const Tensor points = random_points(100);
    const Tensor all = field.evaluate(points).beta_color.detach();
    field.set_level_weights({1, 0.5f, 0});
    const Tensor coarse = field.evaluate(points).beta_color.detach();
    EXPECT_FALSE(at::equal(all, coarse));
    // Weight 0 is the level's entries at 0, and what is saved is what was rendered.
    EditField copy(small_edit_config("change"), {}, 9);
    {
        at::NoGradGuard no_grad;
        const auto folded = field.tensors();
        for (const auto& [name, parameter] : copy.parameters()) parameter.copy_(folded.at(name));
    }
    EXPECT_TRUE(at::allclose(copy.evaluate(points).beta_color, coarse, 1e-6, 1e-7));
    EXPECT_THROW(field.set_level_weights({1, 1}), std::invalid_argument);
    EXPECT_THROW(field.set_level_weights({1, 1, 2}), std::invalid_argument);
}

TEST(EditSupport, HoldsTheCellsWhereTheEditActs) {
    EditField field(small_edit_config("change"), {}, 5);
    {
        at::NoGradGuard
            no_grad;  // βc = sigmoid of a ramp along the table: off at the bound, 3.4e-4, unless features say so
        field.parameters().at("beta_color.bias").fill_(-1000);
    }
    const Tensor everywhere = at::ones({8, 8, 8}, at::kByte);
    EXPECT_EQ(edit_support(field, everywhere, 0.01).sum().item<std::int64_t>(), 0);
    {
        at::NoGradGuard no_grad;
        field.parameters().at("beta_color.bias").fill_(0);
    }
    EXPECT_TRUE(at::equal(edit_support(field, everywhere, 0.01), everywhere));
    EXPECT_TRUE(at::equal(edit_support(field, half_support(), 0.01), half_support()));  // only candidates
    EXPECT_THROW(edit_support(field, at::ones({8, 8}, at::kByte), 0.01), std::invalid_argument);
}

TEST(JitterPenalty, IsZeroForAConstantAndPositiveElse) {
    EditField field(small_edit_config("add,remove,change"), {}, 6);
    const Tensor points = random_points(200);
    Random random(1);
    const Tensor rough = jitter_penalty(field, field.evaluate(points), points, 0.05, random);
    EXPECT_GT(rough.item<float>(), 0);
    rough.backward();
    EXPECT_GT(field.parameters().at("grid.table").grad().abs().sum().item<float>(), 0);
    {
        at::NoGradGuard no_grad;
        field.parameters().at("grid.table").fill_(0.1);
    }
    EXPECT_LT(jitter_penalty(field, field.evaluate(points), points, 0.05, random).item<float>(), 1e-12);
    EXPECT_EQ(
        jitter_penalty(field, field.evaluate(points.slice(0, 0, 0)), points.slice(0, 0, 0), 0.05, random).item<float>(),
        0);
}

class EditFileTest : public testing::Test {
  protected:
    void SetUp() override {
        folder_ = std::filesystem::temp_directory_path() / ("fieldgraft_edit_test_" + std::to_string(::getpid()));
        std::filesystem::create_directories(folder_);
        edit_.field = std::make_shared<EditField>(small_edit_config("add,change"), FieldGeometry{}, 1);
        edit_.field->set_support(half_support());
        edit_.field_hash = "0123456789abcdef";
        edit_.stack = {"aa", "bb"};
        edit_.specification = {{"source", "ball"}, {"target", "red ball"}};
        edit_.strength_change = 0.25f;
    }
    void TearDown() override { std::filesystem::remove_all(folder_); }
    std::filesystem::path path() const { return folder_ / "edit.safetensors"; }
    std::string load_error() const {
        try {
            EditFile::load(path());
        } catch (const InputError& error) {
            return error.what();
        }
        return "no error";
    }

    std::filesystem::path folder_;
    EditFile edit_;
};

TEST_F(EditFileTest, RoundTrip) {
    edit_.save(path());
    const EditFile back = EditFile::load(path());
    const Tensor points = random_points(100);
    const EditSamples before = edit_.field->evaluate(points), after = back.field->evaluate(points);
    EXPECT_TRUE(at::equal(before.density_e, after.density_e));
    EXPECT_TRUE(at::equal(before.color_e, after.color_e));
    EXPECT_TRUE(at::equal(before.beta_color, after.beta_color));
    EXPECT_TRUE(at::equal(back.field->support(), half_support()));
    EXPECT_EQ(back.field_hash, edit_.field_hash);
    EXPECT_EQ(back.stack, edit_.stack);
    EXPECT_EQ(back.specification, edit_.specification);
    EXPECT_EQ(back.strength_change, 0.25f);
    EXPECT_EQ(back.strength_add, 1.0f);
    EXPECT_EQ(back.hash(), edit_.hash());
}

TEST_F(EditFileTest, HashFollowsContentNotStrengths) {
    const std::string hash = edit_.hash();
    edit_.strength_add = 0;
    edit_.specification["target"] = "blue ball";
    EXPECT_EQ(edit_.hash(), hash);
    at::NoGradGuard no_grad;
    edit_.field->parameters().at("hidden.bias")[0] += 1;
    EXPECT_NE(edit_.hash(), hash);
}

TEST_F(EditFileTest, AnotherFieldIsAnErrorAnotherStackAWarning) {
    EXPECT_NO_THROW(edit_.check_field("0123456789abcdef", "e"));
    EXPECT_THROW(edit_.check_field("f00d", "e"), InputError);
    EXPECT_EQ(edit_.check_stack({"aa", "bb"}, "e"), "");
    EXPECT_NE(edit_.check_stack({"aa"}, "e").find("e: "), std::string::npos);
    EXPECT_NE(edit_.check_stack({"bb", "aa"}, "e").find("others"), std::string::npos);
}

TEST_F(EditFileTest, BrokenFilesAreNamed) {
    EXPECT_THROW(EditFile::load(path()), InputError);  // missing
    edit_.save(path());
    const std::string whole = read_file(path());
    write_file(path(), std::string_view(whole).substr(0, whole.size() - 100));
    EXPECT_THROW(EditFile::load(path()), InputError);
    save_safetensors(path(), {{"x", at::zeros({1})}}, {{"format", "fieldgraft.field"}});
    EXPECT_NE(load_error().find("not an edit file"), std::string::npos);

    edit_.save(path());
    const SafeTensors file = load_safetensors(path());
    auto tensors = file.tensors;
    tensors.erase("hidden.bias");
    save_safetensors(path(), tensors, file.metadata);
    EXPECT_NE(load_error().find("hidden.bias"), std::string::npos);
    tensors = file.tensors;
    tensors["grid.table"] = at::zeros({3, 4});
    save_safetensors(path(), tensors, file.metadata);
    EXPECT_NE(load_error().find("3×4"), std::string::npos);
    auto metadata = file.metadata;
    metadata["strengths"] = R"({"add": 2, "remove": 1, "change": 1})";
    save_safetensors(path(), file.tensors, metadata);
    EXPECT_NE(load_error().find("strength"), std::string::npos);
    metadata = file.metadata;
    metadata["config"] = "{";
    save_safetensors(path(), file.tensors, metadata);
    EXPECT_NE(load_error().find("config"), std::string::npos);
}

TEST_F(EditFileTest, NeedsItsSupport) {
    edit_.field->set_support({});
    EXPECT_THROW(edit_.save(path()), std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
