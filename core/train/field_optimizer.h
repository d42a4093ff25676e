// Adam over a field's parameters (core/kernels/adam_ref.h): entries of the hash table that a step did not touch keep
// their moments, network weights are always stepped.
#pragma once

#include <map>
#include <string>

#include "core/field/radiance_field.h"

namespace fieldgraft {

class FieldOptimizer {
  public:
    explicit FieldOptimizer(const RadianceField& field);
    // Uses the parameters' gradients and drops them. If any of them is NaN or infinite nothing changes: false.
    bool step(const RadianceField& field, double rate);

    std::int64_t steps() const { return steps_; }
    // For checkpoints: "m.NAME" and "v.NAME".
    std::map<std::string, Tensor> moments() const;
    void restore(const std::map<std::string, Tensor>& moments, std::int64_t steps);

  private:
    std::map<std::string, Tensor> m_, v_;
    std::int64_t steps_ = 0;
};

}  // namespace fieldgraft
