// Words and pictures in, tensors out: the image tower, the text tower, the tokenizer and the segmenter of a guidance
// model behind one interface. The built-in model, OpenAI's CLIP and CLIPSeg in the Hugging Face folder layout are the
// same code.
//
// Images are N×3×h×w, RGB in [0, 1], any h and w ≥ 1 (resized and normalised inside). Embeddings are CLIP's
// projections, N×D float32, not normalised. Differentiable: encode_image and segment in the pixels, from end to end.
// Not differentiable: anything in a text (embeddings are computed without a graph and kept per string); the weights are
// frozen. Agrees with transformers to 1e-4 in float32 (tests/guidance/test_parity.py). All methods may be called from
// several threads.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/torch.h"
#include "core/guidance/config.h"

namespace fieldgraft {

struct GuidanceOptions {
    torch::Device device = torch::kCPU;
    // The image tower's type: kFloat, kBFloat16 (fastest_image_type(): about a third of the time where the processor
    // has it), or kDouble.
    torch::ScalarType image_type = torch::kFloat;
};

// kBFloat16 where the processor computes it in hardware (AVX-512-BF16 or AMX), else kFloat.
torch::ScalarType fastest_image_type();

class Guidance {
  public:
    // The segmenter is the folder's own, or that of segmenter_folder (with its own towers) if one is given.
    // Throws InputError: no folder, missing or malformed file, missing tensor, wrong shape, unknown model_type.
    static std::shared_ptr<Guidance> load(const std::filesystem::path& folder,
                                          const std::filesystem::path& segmenter_folder = {},
                                          const GuidanceOptions& options = {});
    ~Guidance();

    Tensor encode_text(const std::vector<std::string>& texts);
    Tensor encode_image(const Tensor& images) const;
    // Logits N×h×w at the images' own size: one text an image, or one for all.
    Tensor segment(const Tensor& images, const std::vector<std::string>& texts);
    // Every image with every text, N×T×h×w; the image tower runs once.
    Tensor segment_each(const Tensor& images, const std::vector<std::string>& texts);

    bool has_segmenter() const;
    const std::vector<std::string>& templates() const;
    const GuidanceConfig& config() const;
    // SHA-256 over the tensors of the model, and of the segmenter's if that is another folder; read once, on the first
    // call.
    std::string hash();
    // The words of a text that a model with a list of known words (words.txt) never saw, in order, each once.
    std::vector<std::string> unknown_words(std::string_view text) const;
    // Throws InputError if the two prompts are the same to the model (there would be no direction between them), or if
    // one holds no word at all.
    void check_prompts(const std::string& source, const std::string& target) const;

  private:
    struct Model;
    Guidance();
    static std::shared_ptr<Model> load_model(const std::filesystem::path& folder, const GuidanceOptions& options);
    static Tensor encode_text(Model& model, const std::vector<std::string>& texts);
    Model& segmenter() const;

    std::shared_ptr<Model> model_, segmenter_;
    std::string hash_;
};

}  // namespace fieldgraft
