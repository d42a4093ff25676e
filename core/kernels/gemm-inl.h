// Small matrix products whose operands stay in the first-level cache; included once per instruction set (Highway).
//
//   C (m×n) = [C +] Σ_k a(m, k) B(k, n)        a(i, k) = a[i·a_row + k·a_step],  B and C row-major
//
// n is a multiple of `lane_multiple` (16 floats): rows are padded with zeros. a is broadcast, so any strides cost the
// same: a weight gradient Σ_s x(s, in) y(s, out) is a product whose a walks down the columns of x. Sums run in order of
// k with fused multiply-adds: bits do not depend on m or n, but differ between instruction sets only by rounding of
// the same sum (FMA or not).
#include <algorithm>
#include <cstddef>

#include <hwy/highway.h>

#if defined(FIELDGRAFT_GEMM_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef FIELDGRAFT_GEMM_INL_H
#undef FIELDGRAFT_GEMM_INL_H
#else
#define FIELDGRAFT_GEMM_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace fieldgraft {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Lanes = hn::ScalableTag<float>;
using Vector = hn::Vec<Lanes>;
constexpr std::size_t lanes = HWY_LANES(float);
constexpr bool many_registers = HWY_TARGET <= HWY_AVX3;

// What happens to the sums: written, added to C, written with negative values set to 0, or written where gate > 0
// (ReLU's derivative; gate has C's layout).
enum class Store { write, add, relu, gated };

struct Operands {
    const float* a;
    std::size_t a_row, a_step;
    const float* b;
    std::size_t b_row;
    float* c;
    std::size_t c_row;
    const float* gate;
};

// NaN stays NaN: of two operands x86's maximum returns the second if either is one.
HWY_INLINE Vector relu(Vector value) {
    const Lanes d;
    return hn::Max(hn::Zero(d), value);
}

template <int rows, int columns, Store store>
HWY_INLINE void multiply_block(const Operands& o, int depth) {
    const Lanes d;
    Vector sum[rows][columns];
    for (int r = 0; r < rows; ++r) {
        for (int v = 0; v < columns; ++v) {
            sum[r][v] = store == Store::add ? hn::LoadU(d, o.c + r * o.c_row + v * lanes) : hn::Zero(d);
        }
    }
    const float* HWY_RESTRICT a = o.a;
    const float* HWY_RESTRICT b = o.b;
    for (int k = 0; k < depth; ++k, a += o.a_step, b += o.b_row) {
        Vector line[columns];
        for (int v = 0; v < columns; ++v) line[v] = hn::LoadU(d, b + v * lanes);
        for (int r = 0; r < rows; ++r) {
            const Vector factor = hn::Set(d, a[r * o.a_row]);
            for (int v = 0; v < columns; ++v) sum[r][v] = hn::MulAdd(factor, line[v], sum[r][v]);
        }
    }
    for (int r = 0; r < rows; ++r) {
        for (int v = 0; v < columns; ++v) {
            const std::size_t at = r * o.c_row + v * lanes;
            Vector value = sum[r][v];
            if (store == Store::relu) value = relu(value);
            if (store == Store::gated) {
                value = hn::IfThenElseZero(hn::Gt(hn::LoadU(d, o.gate + at), hn::Zero(d)), value);
            }
            hn::StoreU(value, d, o.c + at);
        }
    }
}

// Rows of a block: as many sums as registers hold beside one line of B.
template <int columns>
constexpr int block_rows() {
    if (many_registers) return columns == 4 ? 6 : columns == 3 ? 8 : columns == 2 ? 12 : 14;
    return columns == 2 ? 6 : 10;
}
constexpr int widest_block = many_registers ? 4 : 2;

template <int rows, int columns, Store store>
HWY_INLINE void multiply_rest(const Operands& o, int count, int depth) {
    if constexpr (rows > 0) {
        if (count == rows) return multiply_block<rows, columns, store>(o, depth);
        multiply_rest<rows - 1, columns, store>(o, count, depth);
    }
}

template <int columns, Store store>
HWY_NOINLINE void multiply_rows(Operands o, int m, int depth) {
    constexpr int rows = block_rows<columns>();
    for (; m >= rows; m -= rows) {
        multiply_block<rows, columns, store>(o, depth);
        o.a += rows * o.a_row;
        o.c += rows * o.c_row;
        if (store == Store::gated) o.gate += rows * o.c_row;
    }
    multiply_rest<rows - 1, columns, store>(o, m, depth);
}

// m rows, n columns (a multiple of 16), depth products a sum.
template <Store store>
HWY_INLINE void multiply(Operands o, int m, int n, int depth) {
    constexpr int widest = widest_block;
    for (int vectors = n / static_cast<int>(lanes); vectors > 0;) {
        const int columns = vectors < widest ? vectors : widest;
        switch (columns) {
            case 1:
                multiply_rows<1, store>(o, m, depth);
                break;
            case 2:
                multiply_rows<2, store>(o, m, depth);
                break;
            case 3:
                if constexpr (many_registers) multiply_rows<3, store>(o, m, depth);
                break;
            case 4:
                if constexpr (many_registers) multiply_rows<4, store>(o, m, depth);
                break;
        }
        vectors -= columns;
        const std::size_t step = columns * lanes;
        o.b += step;
        o.c += step;
        if (store == Store::gated) o.gate += step;
    }
}

// A row-major matrix times a row-major matrix.
template <Store store>
HWY_INLINE void rows_times(const float* a, int a_row, const float* b, float* c, int m, int n, int depth,
                           const float* gate = nullptr) {
    multiply<store>({a, std::size_t(a_row), 1, b, std::size_t(n), c, std::size_t(n), gate}, m, n, depth);
}

// gradient (in×out) += Σ over samples of x (samples×in, row length x_row) and y (samples×out).
HWY_INLINE void add_outer(const float* x, int x_row, int in, const float* y, int out, int samples, float* gradient) {
    multiply<Store::add>({x, 1, std::size_t(x_row), y, std::size_t(out), gradient, std::size_t(out), nullptr}, in, out,
                         samples);
}

// Layers over rows of samples work in tiles, whose activations stay in the first-level cache.
constexpr int tile = 48;

// Calls body(first, count) for tiles of n samples.
template <class Body>
HWY_INLINE void for_tiles(int n, Body body) {
    for (int first = 0; first < n; first += tile) body(std::size_t(first), std::min(tile, n - first));
}

}  // namespace HWY_NAMESPACE
}  // namespace fieldgraft
HWY_AFTER_NAMESPACE();

#endif  // per target
