// One step of Adam over part of the parameters: SIMD, dispatched at run time, one thread. What is computed is
// adam_ref.h's with the same skip_zero, to the same bits where the machine rounds sums and products one by one, else
// (fused multiply-adds) within 4 ε of each moment.
#pragma once

#include <span>

#include "core/kernels/adam_ref.h"

namespace fieldgraft {

// All spans of one length. Throws std::invalid_argument as adam_step.
void adam_step_part(const AdamStep& step, std::span<const float> grad, std::span<float> parameters, std::span<float> m,
                    std::span<float> v);

}  // namespace fieldgraft
