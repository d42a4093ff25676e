// Colours of a block of visible samples, and what the colour network leaves for its backward pass.
#pragma once

#include <vector>

#include "core/render/visible_rays.h"

namespace fieldgraft {

// Kept from block to block for its memory.
struct BlockColors {
    std::vector<float> base, hidden0, hidden1;  // rows
    std::vector<float> color;                   // N×3

    void compute(const KernelField& field, const RayBlock& block) {
        const std::size_t n = block.samples(), rays = block.rays();
        base.resize(rays * field.hidden_row);
        hidden0.resize(n * field.hidden_row);
        hidden1.resize(n * field.hidden_row);
        color.resize(3 * n);
        ray_color_base(field.weights, block.basis.data(), static_cast<int>(rays), base.data());
        color_mlp_forward(field.weights, block.features.data(), block.ray.data(), base.data(), static_cast<int>(n),
                          hidden0.data(), hidden1.data(), color.data());
    }
};

}  // namespace fieldgraft
