// Adam (Kingma and Ba 2015) over named float32 tensors, with bias correction and a guard against bad gradients.
//
//   m ← β₁ m + (1 − β₁) g     v ← β₂ v + (1 − β₂) g²     p ← p − lr · m̂ / (√v̂ + ε)
// A step whose gradients hold a NaN or an Inf is not taken: it leaves parameters, moments and the count as they were.
#pragma once

#include <map>
#include <string>

#include "core/base/torch.h"

namespace fieldgraft {

class Adam {
  public:
    explicit Adam(const std::map<std::string, Tensor>& parameters, double beta1 = 0.9, double beta2 = 0.99,
                  double epsilon = 1e-10);

    // One step on the parameters' own gradients, which are cleared. False if they were not finite.
    bool step(double learning_rate);
    std::int64_t steps() const { return steps_; }

    // The moments as "m.NAME" and "v.NAME", and the count as "steps": for a checkpoint and back.
    std::map<std::string, Tensor> state() const;
    void restore(const std::map<std::string, Tensor>& state);

  private:
    std::map<std::string, Tensor> parameters_, first_, second_;
    double beta1_, beta2_, epsilon_;
    std::int64_t steps_ = 0;
};

}  // namespace fieldgraft
