// The field's networks in bfloat16 on AMX tiles: the same functions as field_mlp_simd.h's, for machines that have them.
//
// Products are of bfloat16 numbers (8 bits), sums in float32. Activations and gradients enter and leave as float32;
// every operand of a product is rounded once, to nearest. Errors against exact arithmetic: a sum of m products within
// (2⁻⁷ + m ε) Σ|w h|. Denormals count as 0. Rows beyond the last sample are computed as zeros, so bits do not depend on
// how samples are split into calls, except for gradients' sums.
//
// Plain pointers and no library code: the file is compiled with instructions that other machines lack.
#pragma once

#include <cstddef>
#include <cstdint>

namespace fieldgraft::amx {

// The machine has the tiles and the system lets this process use them.
bool available();

constexpr int widest = 128;  // padded width of any layer

// Bfloat16 numbers of an in×out matrix as tiles read it; in and out padded to 16.
std::size_t tiles_size(int in, int out);
void pack_tiles(const float* matrix, int in, int out, std::uint16_t* tiles);

// Padded widths, and the matrices as pack_tiles leaves them; "back": out×in.
struct DensityNetwork {
    int encoded, hidden, features;
    const std::uint16_t *first, *second, *first_back, *second_back;
};
struct ColorNetwork {
    int features, hidden;
    const std::uint16_t *first, *second, *last, *first_back, *second_back;  // last: 3 columns, padded
    const float* last_rows;                                                 // 3×hidden
};

void density_forward(const DensityNetwork& network, const float* encoded, int n, float* features);
// Adds to first_grad (encoded×hidden) and second_grad (hidden×features).
void density_backward(const DensityNetwork& network, const float* encoded, const float* features_grad, int n,
                      float* first_grad, float* second_grad, float* encoded_grad);

// logits n×3: the colours before the sigmoid.
void color_forward(const ColorNetwork& network, const float* features, const std::int32_t* ray, const float* base,
                   int n, float* hidden0, float* hidden1, float* logits);
// logit_grad n×3. Adds to first_grad (features×hidden), second_grad (hidden×hidden), last_grad (3×hidden), base_grad.
void color_backward(const ColorNetwork& network, const float* features, const std::int32_t* ray, const float* hidden0,
                    const float* hidden1, const float* logit_grad, int n, float* first_grad, float* second_grad,
                    float* last_grad, float* base_grad, float* features_grad);

}  // namespace fieldgraft::amx
