// The tensors of a model file, handed out by name with their shapes checked. Stored as float16, bfloat16 or float32;
// handed out in float32 (or the tower's own type), frozen: no gradient ever reaches a weight.
// A missing name or another shape than config.json asks for is an InputError that names the file, the tensor and both
// shapes.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/base/safetensors.h"
#include "core/base/torch.h"

namespace fieldgraft {

class Weights {
  public:
    // type: what vision weights are computed in (kFloat, kBFloat16 or, for tests, kDouble).
    Weights(std::shared_ptr<const SafeTensors> file, torch::ScalarType type, torch::Device device);

    // The same file seen from below `prefix` (which brings its own dot: "visual.").
    Weights below(const std::string& prefix) const;
    // The same file in another type.
    Weights as(torch::ScalarType type) const;

    bool has(const std::string& name) const;
    Tensor take(const std::string& name, std::vector<std::int64_t> shape) const;
    torch::ScalarType type() const { return type_; }

  private:
    std::shared_ptr<const SafeTensors> file_;
    std::string prefix_;
    torch::ScalarType type_;
    torch::Device device_;
};

}  // namespace fieldgraft
