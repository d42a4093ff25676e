// A guidance folder with a tiny random model in the built-in layout (modified ResNet, FiLM pyramid), for the tests.
#pragma once

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <map>
#include <string>

#include "core/base/errors.h"
#include "core/base/files.h"
#include "core/base/json.h"
#include "core/base/random.h"
#include "core/base/safetensors.h"
#include "core/base/torch.h"

namespace fieldgraft {

// Standard normal numbers, the same on every machine.
inline Tensor normal(Random& random, const std::vector<std::int64_t>& shape, double scale = 1,
                     torch::ScalarType type = torch::kFloat) {
    Tensor out = at::empty(shape, torch::kDouble);
    for (double& x : std::span(out.data_ptr<double>(), static_cast<std::size_t>(out.numel())))
        x = scale * random.normal();
    return out.to(type);
}

inline Tensor uniform_image(Random& random, const std::vector<std::int64_t>& shape,
                            torch::ScalarType type = torch::kFloat) {
    Tensor out = at::empty(shape, torch::kDouble);
    for (double& x : std::span(out.data_ptr<double>(), static_cast<std::size_t>(out.numel()))) x = random.uniform();
    return out.to(type);
}

// A folder of its own under the system's temporary folder, removed at the end.
class TemporaryFolder {
  public:
    TemporaryFolder() {
        const std::string placeholder(6, 'X');  // what mkdtemp fills in
        std::string name = (std::filesystem::temp_directory_path() / ("fieldgraft_test_" + placeholder)).string();
        if (!mkdtemp(name.data())) failure("cannot make {}", name);
        path_ = name;
    }
    ~TemporaryFolder() { std::filesystem::remove_all(path_); }
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;
    const std::filesystem::path& path() const { return path_; }

  private:
    std::filesystem::path path_;
};

struct TinyModel {
    Json config;
    std::map<std::string, Tensor> tensors;
    Json vocabulary;
    std::string merges = "#version: 0.2\nr e\nre d</w>\nb a\nba l\nbal l</w>\n";
    std::string words = "red\nball\nphoto\na\nof\npolka-dotted\n";

    explicit TinyModel(std::uint64_t seed = 1, bool stem_pool = false, int conditional = 2) {
        Random random(seed);
        make_vocabulary();
        config = {
            {"model_type", "fieldgraft-guidance"},
            {"projection_dim", 6},
            {"text_config",
             {{"hidden_size", 8},
              {"intermediate_size", 12},
              {"num_attention_heads", 2},
              {"num_hidden_layers", 2},
              {"max_position_embeddings", 10},
              {"vocab_size", vocabulary.size()},
              {"hidden_act", "quick_gelu"}}},
            {"vision_config",
             {{"trunk", "modified_resnet"},
              {"image_size", 32},
              {"width", 4},
              {"layers", {1, 2, 1, 1}},
              {"stem_pool", stem_pool},
              {"num_attention_heads", 4}}},
            {"segmenter_config",
             {{"type", "film_pyramid"}, {"stages", {0, 2, 4}}, {"reduce_dim", 5}, {"conditional_stage", conditional}}},
            {"preprocess", {{"image_size", 32}, {"image_mean", {0.5, 0.4, 0.3}}, {"image_std", {0.2, 0.3, 0.25}}}},
            {"augmentation", {{"brightness", 0.1}, {"contrast", 0.2}, {"saturation", 0.3}}},
            {"templates", {"{}", "a photo of {}"}}};
        text_tower(random);
        trunk(random, stem_pool);
        decoder(random, conditional);
    }

    void write(const std::filesystem::path& folder) const {
        write_json(folder / "config.json", config);
        save_safetensors(folder / "model.safetensors", tensors);
        write_json(folder / "vocab.json", vocabulary);
        write_file(folder / "merges.txt", merges);
        if (!words.empty()) write_file(folder / "words.txt", words);
    }

  private:
    void make_vocabulary() {
        std::vector<std::string> tokens;
        for (char c = '!'; c <= '~'; ++c) tokens.emplace_back(1, c);
        const std::size_t singles = tokens.size();
        for (std::size_t i = 0; i < singles; ++i) tokens.push_back(tokens[i] + "</w>");
        for (const char* merged : {"re", "red</w>", "ba", "bal", "ball</w>", "<|startoftext|>", "<|endoftext|>"})
            tokens.emplace_back(merged);
        for (std::size_t i = 0; i < tokens.size(); ++i) vocabulary[tokens[i]] = i;
    }

    // Scaled so that signals neither die nor explode through the layers.
    void add(Random& random, const std::string& name, const std::vector<std::int64_t>& shape) {
        std::int64_t inputs = 1;
        for (std::size_t i = 1; i < shape.size(); ++i) inputs *= shape[i];
        tensors[name] = normal(random, shape, shape.size() > 1 ? 1 / std::sqrt(static_cast<double>(inputs)) : 0.1);
    }
    void linear(Random& random, const std::string& name, int in, int out, bool bias = true) {
        add(random, name + ".weight", {out, in});
        if (bias) add(random, name + ".bias", {out});
    }
    void norm(Random& random, const std::string& name, int size) {
        tensors[name + ".weight"] = 1 + normal(random, {size}, 0.1);
        add(random, name + ".bias", {size});
    }
    void conv_norm(Random& random, const std::string& conv, const std::string& bn, int in, int out, int kernel) {
        tensors[conv + ".weight"] = normal(random, {out, in, kernel, kernel}, std::sqrt(2.0 / (in * kernel * kernel)));
        norm(random, bn, out);
        add(random, bn + ".running_mean", {out});
        tensors[bn + ".running_var"] = 1 + normal(random, {out}, 0.2).abs();
    }

    void text_tower(Random& random) {
        const int width = 8;
        add(random, "text_model.embeddings.token_embedding.weight",
            {static_cast<std::int64_t>(vocabulary.size()), width});
        add(random, "text_model.embeddings.position_embedding.weight", {10, width});
        for (int i = 0; i < 2; ++i) {
            const std::string layer = fmt::format("text_model.encoder.layers.{}.", i);
            norm(random, layer + "layer_norm1", width);
            norm(random, layer + "layer_norm2", width);
            for (const char* part : {"q_proj", "k_proj", "v_proj", "out_proj"})
                linear(random, layer + "self_attn." + part, width, width);
            linear(random, layer + "mlp.fc1", width, 12);
            linear(random, layer + "mlp.fc2", 12, width);
        }
        norm(random, "text_model.final_layer_norm", width);
        linear(random, "text_projection", width, 6, false);
    }

    void trunk(Random& random, bool stem_pool) {
        const int width = 4, side = stem_pool ? 1 : 2;
        conv_norm(random, "visual.conv1", "visual.bn1", 3, width / 2, 3);
        conv_norm(random, "visual.conv2", "visual.bn2", width / 2, width / 2, 3);
        conv_norm(random, "visual.conv3", "visual.bn3", width / 2, width, 3);
        int in = width;
        const std::array<int, 4> counts{1, 2, 1, 1};
        for (int stage = 0; stage < 4; ++stage)
            for (int i = 0; i < counts[stage]; ++i) {
                const std::string block = fmt::format("visual.layer{}.{}.", stage + 1, i);
                const int planes = width << stage;
                conv_norm(random, block + "conv1", block + "bn1", in, planes, 1);
                conv_norm(random, block + "conv2", block + "bn2", planes, planes, 3);
                conv_norm(random, block + "conv3", block + "bn3", planes, planes * 4, 1);
                if (i == 0) conv_norm(random, block + "downsample.0", block + "downsample.1", in, planes * 4, 1);
                in = planes * 4;
            }
        add(random, "visual.attnpool.positional_embedding", {1 + side * side, in});
        for (const char* part : {"q_proj", "k_proj", "v_proj"})
            linear(random, std::string("visual.attnpool.") + part, in, in);
        linear(random, "visual.attnpool.c_proj", in, 6);
    }

    void decoder(Random& random, int conditional) {
        const std::map<int, int> channels{{0, 4}, {2, 32}, {4, 128}};
        for (const auto& [stage, count] : channels) {
            const std::string number = std::to_string(stage);
            add(random, "decoder.reduces." + number + ".weight", {5, count, 1, 1});
            add(random, "decoder.reduces." + number + ".bias", {5});
            for (const std::string conv : {"conv1", "conv2"}) {
                add(random, "decoder.blocks." + number + "." + conv + ".weight", {5, 5, 3, 3});
                add(random, "decoder.blocks." + number + "." + conv + ".bias", {5});
            }
            if (conditional >= 0 && conditional != stage) continue;
            const std::string suffix = conditional < 0 ? "." + number : "";
            linear(random, "decoder.film_mul" + suffix, 6, 5);
            linear(random, "decoder.film_add" + suffix, 6, 5);
        }
        add(random, "decoder.head.weight", {1, 5, 3, 3});
        add(random, "decoder.head.bias", {1});
    }
};

// What the call throws; "" if nothing.
template <class Error>
std::string message_of(const std::function<void()>& call) {
    try {
        call();
    } catch (const Error& error) {
        return error.what();
    }
    return "";
}

// The largest difference between the gradient of f (scalar, double) at x and central differences, over `probes`
// elements.
inline double gradient_error(const std::function<Tensor(const Tensor&)>& f, const Tensor& x, Random& random,
                             int probes = 24, double step = 1e-6) {
    const Tensor input = x.detach().clone().requires_grad_(true);
    const Tensor gradient = torch::autograd::grad({f(input)}, {input})[0].contiguous();
    const torch::NoGradGuard no_grad;
    double worst = 0;
    for (int i = 0; i < probes; ++i) {
        const auto at = static_cast<std::int64_t>(random.below(static_cast<std::uint32_t>(x.numel())));
        const auto value = [&](double move) {
            const Tensor moved = x.detach().clone().contiguous();
            moved.data_ptr<double>()[at] += move;
            return f(moved).item<double>();
        };
        const double difference = (value(step) - value(-step)) / (2 * step);
        const double expected = gradient.data_ptr<double>()[at];
        worst = std::max(worst, std::abs(difference - expected) / std::max(1.0, std::abs(expected)));
    }
    return worst;
}

}  // namespace fieldgraft
