// The towers, the segmenter and the loader on a tiny random model. What the numbers should be is tested against
// transformers and a PyTorch reference in test_parity.py; here: gradients, shapes, types, caching and errors.
#include <gtest/gtest.h>

#include "core/guidance/guidance.h"
#include "core/guidance/layers.h"
#include "core/guidance/preprocess.h"
#include "core/guidance/vision_tower.h"
#include "tests/guidance/tiny_model.h"

namespace fieldgraft {
namespace {

std::shared_ptr<Guidance> load(const TinyModel& model, const GuidanceOptions& options = {}) {
    const TemporaryFolder folder;
    model.write(folder.path());
    return Guidance::load(folder.path(), {}, options);
}

// The message of the InputError that loading the changed model throws.
std::string load_error(const std::function<void(TinyModel&)>& change) {
    TinyModel model;
    change(model);
    return message_of<InputError>([&] { load(model); });
}

void expect_within(const std::string& message, const std::string& part) {
    EXPECT_NE(message.find(part), std::string::npos) << "message: " << message << "\nwanted: " << part;
    EXPECT_EQ(message.find('\n'), std::string::npos) << "more than one line: " << message;
}

TEST(Attention, UniformScoresAverageAndCausalOnesLookBack) {
    const Tensor zero = at::zeros({1, 3, 4}), v = at::arange(12, torch::kFloat).view({1, 3, 4});
    EXPECT_TRUE(at::allclose(attention(zero, zero, v, 2), v.mean(1, true).expand({1, 3, 4})));
    const Tensor causal = attention(zero, zero, v, 2, true);
    EXPECT_TRUE(at::allclose(causal[0][0], v[0][0]));
    EXPECT_TRUE(at::allclose(causal[0][1], v[0].narrow(0, 0, 2).mean(0)));
}

TEST(Activation, HasItsClosedForm) {
    const Tensor x = at::tensor({-2.0, 0.0, 1.0}, torch::kDouble);
    EXPECT_NEAR(activate(x, "quick_gelu")[2].item<double>(), 1 / (1 + std::exp(-1.702)), 1e-12);
    EXPECT_NEAR(activate(x, "gelu")[2].item<double>(), 0.5 * (1 + std::erf(std::sqrt(0.5))), 1e-12);
    EXPECT_EQ(activate(x, "relu")[0].item<double>(), 0);
    EXPECT_THROW(activate(x, "swish"), std::invalid_argument);
}

TEST(FoldedConv, IsConvolutionThenBatchNorm) {
    Random random(2);
    auto file = std::make_shared<SafeTensors>();
    file->tensors["c.weight"] = normal(random, {4, 3, 3, 3});
    file->tensors["n.weight"] = normal(random, {4});
    file->tensors["n.bias"] = normal(random, {4});
    file->tensors["n.running_mean"] = normal(random, {4});
    file->tensors["n.running_var"] = normal(random, {4}).square() + 0.01;
    const FoldedConv conv = FoldedConv::load(Weights(file, torch::kFloat, torch::kCPU), "c", "n", 3, 4, 3, 2);
    const Tensor x = normal(random, {2, 3, 9, 9});
    const Tensor plain = at::conv2d(x, file->at("c.weight"), {}, 2, 1);
    const Tensor expected = at::batch_norm(plain, file->at("n.weight"), file->at("n.bias"), file->at("n.running_mean"),
                                           file->at("n.running_var"), false, 0, 1e-5, false);
    EXPECT_LT((conv(x) - expected).abs().max().item<float>(), 1e-4);
}

TEST(Preprocess, NormalisesAndKeepsFlatPicturesFlat) {
    const Preprocess settings{8, {0.1, 0.2, 0.3}, {0.5, 0.5, 0.25}, true};
    for (const int size : {1, 3, 8, 50}) {
        const Tensor out = prepare_images(at::full({2, 3, size, 2 * size}, 0.6, torch::kDouble), settings);
        ASSERT_EQ(out.sizes(), at::IntArrayRef({2, 3, 8, 8}));
        EXPECT_NEAR(out.select(1, 0).min().item<double>(), 1, 1e-9);
        EXPECT_NEAR(out.select(1, 2).max().item<double>(), 1.2, 1e-9);
    }
    EXPECT_THROW(prepare_images(at::zeros({3, 8, 8}), settings), std::invalid_argument);
    EXPECT_THROW(prepare_images(at::zeros({1, 3, 8, 8}, torch::kByte), settings), std::invalid_argument);
}

TEST(Guidance, ShapesOfWhatComesOut) {
    Random random(1);
    const auto guidance = load(TinyModel());
    EXPECT_EQ(guidance->encode_text({"red ball", "a photo of a ball", ""}).sizes(), at::IntArrayRef({3, 6}));
    for (const auto& [height, width] : {std::pair(32, 32), std::pair(1, 1), std::pair(50, 33)}) {
        const Tensor images = uniform_image(random, {2, 3, height, width});
        EXPECT_EQ(guidance->encode_image(images).sizes(), at::IntArrayRef({2, 6}));
        EXPECT_EQ(guidance->segment(images, {"red"}).sizes(), at::IntArrayRef({2, height, width}));
        EXPECT_EQ(guidance->segment_each(images, {"red", "ball", "photo"}).sizes(),
                  at::IntArrayRef({2, 3, height, width}));
    }
    EXPECT_EQ(guidance->templates().size(), 2u);
    EXPECT_EQ(guidance->config().augmentation.contrast, 0.2);
    EXPECT_EQ(guidance->hash().size(), 64u);
    EXPECT_THROW(guidance->encode_text({}), std::invalid_argument);
    EXPECT_THROW(guidance->encode_image(at::zeros({1, 4, 8, 8})), std::invalid_argument);
    EXPECT_THROW(guidance->segment(at::zeros({3, 3, 8, 8}), {"a", "b"}), std::invalid_argument);
}

TEST(Guidance, BatchesAndTheCacheChangeNothing) {
    Random random(1);
    const TinyModel model;
    const auto guidance = load(model), other = load(model);
    const std::vector<std::string> texts{"red", "a photo of a red ball", "ball", "red"};
    const Tensor together = guidance->encode_text(texts);
    EXPECT_TRUE(at::equal(together[0], together[3]));
    EXPECT_TRUE(at::equal(guidance->encode_text(texts), together));
    for (std::size_t i = 0; i < texts.size(); ++i)
        EXPECT_TRUE(
            at::allclose(other->encode_text({texts[i]})[0], together[static_cast<std::int64_t>(i)], 1e-5, 1e-6));
    const Tensor images = uniform_image(random, {2, 3, 32, 32});
    const Tensor paired = guidance->segment(images, {"red", "ball"}),
                 each = guidance->segment_each(images, {"red", "ball"});
    EXPECT_TRUE(at::allclose(paired[0], each[0][0], 1e-5, 1e-5));
    EXPECT_TRUE(at::allclose(paired[1], each[1][1], 1e-5, 1e-5));
    EXPECT_GT((paired[0] - each[0][1]).abs().max().item<float>(), 1e-4) << "the text must matter";
}

TEST(Guidance, GradientsReachThePixelsAndNothingElse) {
    Random random(5);
    for (const int conditional : {2, -1}) {
        const auto guidance = load(TinyModel(3, conditional < 0, conditional), {.image_type = torch::kDouble});
        const Tensor images = uniform_image(random, {1, 3, 40, 36}, torch::kDouble);
        const Tensor direction = normal(random, {1, 6}, 1, torch::kDouble);
        const Tensor weight = normal(random, {1, 40, 36}, 1, torch::kDouble);
        EXPECT_LT(gradient_error([&](const Tensor& x) { return (guidance->encode_image(x) * direction).sum(); }, images,
                                 random),
                  1e-6);
        EXPECT_LT(gradient_error([&](const Tensor& x) { return (guidance->segment(x, {"red"}) * weight).sum(); },
                                 images, random),
                  1e-6);
    }
    const auto guidance = load(TinyModel());
    EXPECT_FALSE(guidance->encode_text({"red"}).requires_grad());
    EXPECT_FALSE(guidance->encode_image(at::rand({1, 3, 32, 32})).requires_grad());
}

TEST(Guidance, BFloat16IsClose) {
    Random random(5);
    const TinyModel model;
    const auto exact = load(model), half = load(model, {.image_type = torch::kBFloat16});
    const Tensor images = uniform_image(random, {4, 3, 32, 32}).requires_grad_(true);
    const Tensor a = exact->encode_image(images), b = half->encode_image(images);
    EXPECT_EQ(b.scalar_type(), torch::kFloat);
    EXPECT_GT(at::cosine_similarity(a, b).min().item<float>(), 0.99);
    const Tensor exact_gradient = torch::autograd::grad({a.sum()}, {images})[0];
    const Tensor gradient = torch::autograd::grad({b.sum()}, {images})[0];
    EXPECT_GT(at::cosine_similarity(gradient.flatten(), exact_gradient.flatten(), 0).item<float>(), 0.95);
    EXPECT_TRUE(fastest_image_type() == torch::kBFloat16 || fastest_image_type() == torch::kFloat);
    EXPECT_EQ(half->segment(images, {"red"}).scalar_type(), torch::kFloat);
    const TemporaryFolder folder;
    model.write(folder.path());
    EXPECT_THROW(Guidance::load(folder.path(), {}, {.image_type = torch::kInt}), std::invalid_argument);
}

TEST(Guidance, HalfPrecisionFilesAreRead) {
    Random random(6);
    TinyModel model;
    const auto exact = load(model);
    for (auto& [name, tensor] : model.tensors) tensor = tensor.to(torch::kHalf);
    const auto half = load(model);
    const Tensor images = uniform_image(random, {1, 3, 32, 32});
    EXPECT_LT((exact->encode_image(images) - half->encode_image(images)).abs().max().item<float>(), 0.05);
    EXPECT_NE(exact->hash(), half->hash());
}

TEST(Guidance, UnknownWordsAreNamedOnce) {
    const auto guidance = load(TinyModel());
    EXPECT_EQ(guidance->unknown_words("a RED dragon of Dragon fire, polka-dotted"),
              (std::vector<std::string>{"dragon", "fire"}));
    TinyModel open;
    open.words = "";
    EXPECT_TRUE(load(open)->unknown_words("a dragon").empty());
}

TEST(Guidance, PromptsWithoutADifferenceAreRefused) {
    const auto guidance = load(TinyModel());
    EXPECT_NO_THROW(guidance->check_prompts("red ball", "ball"));
    expect_within(message_of<InputError>([&] { guidance->check_prompts("red ball", " Red   BALL"); }),
                  "nothing to edit");
    expect_within(message_of<InputError>([&] { guidance->check_prompts("red", "  "); }), "target text is empty");
}

TEST(Guidance, AnotherFoldersSegmenterIsUsed) {
    const TemporaryFolder plain, other;
    TinyModel without, with(7, true, -1);
    without.config.erase("segmenter_config");
    without.write(plain.path());
    with.write(other.path());
    const auto alone = Guidance::load(plain.path());
    EXPECT_FALSE(alone->has_segmenter());
    expect_within(message_of<InputError>([&] { alone->segment(at::rand({1, 3, 8, 8}), {"red"}); }), "has no segmenter");
    expect_within(message_of<InputError>([&] { Guidance::load(other.path(), plain.path()); }), "has no segmenter");
    const auto both = Guidance::load(plain.path(), other.path());
    const Tensor image = at::rand({1, 3, 8, 8});
    EXPECT_TRUE(at::equal(both->segment(image, {"red"}), Guidance::load(other.path())->segment(image, {"red"})));
    EXPECT_TRUE(at::equal(both->encode_image(image), alone->encode_image(image)));
    EXPECT_NE(both->hash(), alone->hash());
}

TEST(GuidanceLoader, NamesWhatIsWrong) {
    const TemporaryFolder empty;
    expect_within(message_of<InputError>([] { Guidance::load("/no/such/folder"); }), "/no/such/folder: not a folder");
    expect_within(message_of<InputError>([&] { Guidance::load(empty.path()); }), "no config.json");
    expect_within(load_error([](TinyModel& m) { m.config["model_type"] = "blip"; }),
                  "model_type 'blip' is unknown: clip, clipseg or fieldgraft-guidance");
    expect_within(load_error([](TinyModel& m) { m.tensors.erase("visual.layer2.1.conv2.weight"); }),
                  "the tensor 'visual.layer2.1.conv2.weight' is missing");
    expect_within(load_error([](TinyModel& m) {
                      m.tensors["text_projection.weight"] = at::zeros({6, 9});
                  }),
                  "'text_projection.weight' has shape [6, 9], config.json asks for [6, 8]");
    expect_within(load_error([](TinyModel& m) { m.tensors["decoder.head.bias"] = at::zeros({1}, torch::kLong); }),
                  "holds integers");
    expect_within(load_error([](TinyModel& m) { m.config["text_config"]["hidden_act"] = "swish"; }),
                  "hidden_act 'swish' is unknown");
    expect_within(load_error([](TinyModel& m) { m.config["text_config"]["vocab_size"] = 50; }), "vocab_size is 50");
    expect_within(load_error([](TinyModel& m) { m.config["text_config"]["hidden_size"] = "8"; }),
                  "\"hidden_size\" has the wrong type");
    expect_within(load_error([](TinyModel& m) { m.config["text_config"]["num_attention_heads"] = 3; }), "no multiple");
    expect_within(load_error([](TinyModel& m) { m.config["vision_config"]["trunk"] = "mamba"; }),
                  "trunk 'mamba' is unknown");
    expect_within(load_error([](TinyModel& m) { m.config["vision_config"]["layers"] = {1, 2}; }), "four counts");
    expect_within(load_error([](TinyModel& m) { m.config["vision_config"]["image_size"] = 40; }), "multiple of 16");
    expect_within(load_error([](TinyModel& m) { m.config["segmenter_config"]["stages"] = {4, 2}; }), "rising numbers");
    expect_within(load_error([](TinyModel& m) { m.config["segmenter_config"]["conditional_stage"] = 3; }),
                  "conditional_stage 3");
    expect_within(load_error([](TinyModel& m) {
                      m.config["preprocess"]["image_std"] = {1, 0, 1};
                  }),
                  "image_std must be above 0");
    expect_within(load_error([](TinyModel& m) { m.config["templates"] = {"a photo"}; }), "must hold {} exactly once");
}

TEST(GuidanceLoader, PickledWeightsGetAHint) {
    const TemporaryFolder folder;
    TinyModel().write(folder.path());
    std::filesystem::rename(folder.path() / "model.safetensors", folder.path() / "pytorch_model.bin");
    expect_within(message_of<InputError>([&] { Guidance::load(folder.path()); }), "save_pretrained");
    std::filesystem::remove(folder.path() / "pytorch_model.bin");
    expect_within(message_of<InputError>([&] { Guidance::load(folder.path()); }), "no model.safetensors");
}

}  // namespace
}  // namespace fieldgraft
