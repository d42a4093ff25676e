// Adam over a field's parameters (core/kernels/adam_ref.h): entries of the hash table that a step did not touch keep
// their moments, network weights are always stepped.
#pragma once

#include <map>
#include <string>

#include "core/field/radiance_field.h"
#include "core/kernels/adam_ref.h"
#include "core/render/ray_pass.h"

namespace fieldgraft {

class FieldOptimizer {
  public:
    explicit FieldOptimizer(const RadianceField& field);
    // One step with what fit_range left. If any of it is NaN or infinite nothing changes: false. The table's gradient
    // is summed level by level, and a level stepped while its sums are in the cache.
    bool step(const RadianceField& field, double rate, const std::vector<RangeFit>& fits);

    std::int64_t steps() const { return steps_; }
    // For checkpoints: "m.NAME" and "v.NAME".
    std::map<std::string, Tensor> moments() const;
    void restore(const std::map<std::string, Tensor>& moments, std::int64_t steps);

  private:
    void step_part(const RadianceField& field, const std::string& name, AdamStep step, std::size_t first,
                   std::span<const float> grad);

    std::map<std::string, Tensor> m_, v_;
    std::int64_t steps_ = 0;
};

}  // namespace fieldgraft
