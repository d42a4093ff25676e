// What a guidance folder's config.json says (and, for models in the Hugging Face layout, its preprocessor_config.json).
//
// model_type "clip"                 OpenAI's CLIP: text transformer, vision transformer, no segmenter
//            "clipseg"              CLIPSeg (Lüddecke and Ecker 2022): CLIP plus a transformer decoder
//            "fieldgraft-guidance"  the built-in model: text transformer, modified ResNet, FiLM pyramid
// Values that a file leaves out take the defaults of the Hugging Face configuration classes. Every problem is an
// InputError of one line that names the file and the key.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "core/base/json.h"

namespace fieldgraft {

struct TransformerConfig {
    int hidden_size = 0;
    int intermediate_size = 0;
    int num_attention_heads = 0;
    int num_hidden_layers = 0;
    std::string hidden_act = "quick_gelu";  // quick_gelu, gelu or relu
    double layer_norm_eps = 1e-5;
};

struct TextConfig : TransformerConfig {
    int max_position_embeddings = 0;
    int vocab_size = 0;
};

struct VisionConfig : TransformerConfig {
    std::string trunk = "vit";  // or "modified_resnet"
    int image_size = 0;
    int patch_size = 0;                 // vit
    int width = 0;                      // modified_resnet: channels of the stem
    std::array<int, 4> layers{};        // modified_resnet: blocks a stage
    bool stem_pool = true;              // modified_resnet: a 2×2 average pool after the stem
    std::vector<int> channels() const;  // modified_resnet: of stages 0 (stem) to 4
};

struct Preprocess {
    int image_size = 0;
    std::array<double, 3> mean{};
    std::array<double, 3> deviation{};
    bool bicubic = false;  // else bilinear; both antialiased
};

struct SegmenterConfig {
    std::string type;       // "" (none), "clipseg" or "film_pyramid"
    std::vector<int> taps;  // clipseg: extract_layers; film_pyramid: stages (both in the file's order)
    int reduce_dim = 0;
    int conditional = 0;  // clipseg: index from the deepest tap; film_pyramid: the stage, −1 for all
    int decoder_heads = 0, decoder_intermediate_size = 0;  // clipseg
    bool refined = false;                                  // clipseg: use_complex_transposed_convolution
    Preprocess preprocess;
};

// DiffAugment's colour ranges that the model can stand (augment.h).
struct ColourRanges {
    double brightness = 0.5, contrast = 0.5, saturation = 1.0;
};

struct GuidanceConfig {
    std::string model_type;
    int projection_dim = 0;
    TextConfig text;
    VisionConfig vision;
    SegmenterConfig segmenter;
    Preprocess preprocess;  // of the image tower
    ColourRanges augmentation;
    std::vector<std::string> templates;  // never empty; each holds one "{}"
};

// Reads folder/config.json. Throws InputError.
GuidanceConfig load_guidance_config(const std::filesystem::path& folder);

}  // namespace fieldgraft
