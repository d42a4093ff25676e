#include "core/kernels/field_mlp_amx.h"

#ifdef FIELDGRAFT_AMX

#include <cpuid.h>
#include <immintrin.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace fieldgraft::amx {
namespace {

using Bits = std::uint16_t;  // a bfloat16 number

// A group of samples is two tiles of rows, and the depth of one tile when sums run over samples.
constexpr int group = 32;
constexpr int groups = 4;                   // whose gradients of the weights are summed in one go
constexpr int tile_values = 16 * 32;        // bfloat16 numbers of a tile
constexpr int part = group * widest;        // of a group, in one layer
constexpr std::size_t tile_row_bytes = 64;  // of a tile stored by itself

constexpr int deep(int width) {
    return (width + 31) / 32 * 32;
}

struct alignas(64) TileShapes {
    std::uint8_t palette = 1, start_row = 0, reserved[14] = {};
    std::uint16_t row_bytes[16] = {64, 64, 64, 64, 64, 64, 64, 64};
    std::uint8_t rows[16] = {16, 16, 16, 16, 16, 16, 16, 16};
};

// Tiles are the thread's; others (libtorch's) set them up anew before they use them, as this does.
struct Tiles {
    Tiles() {
        const TileShapes shapes;
        _tile_loadconfig(&shapes);
    }
    ~Tiles() { _tile_release(); }
};

__m512i two_vectors(__m512 low, __m512 high) {
    return (__m512i)_mm512_cvtne2ps_pbh(high, low);
}

// group×width floats, rows of `row`, as bfloat16 rows of deep(width); rows from `count` on are zeros.
void to_rows(const float* x, std::size_t row, int width, int count, Bits* to) {
    const int depth = deep(width);
    for (int s = 0; s < group; ++s) {
        for (int i = 0; i < depth; i += 32) {
            __m512 low = _mm512_setzero_ps(), high = low;
            if (s < count) {
                low = _mm512_loadu_ps(x + s * row + i);
                if (i + 16 < width) high = _mm512_loadu_ps(x + s * row + i + 16);
            }
            _mm512_store_si512(to + s * depth + i, two_vectors(low, high));
        }
    }
}

// group×width floats as the right operand of a sum over samples: for every 16 columns a tile of 16 rows, row j holding
// samples 2j and 2j + 1 side by side.
void to_pairs(const float* x, std::size_t row, int width, int count, Bits* to) {
    alignas(64) static constexpr std::uint16_t order[32] = {0,  16, 1,  17, 2,  18, 3,  19, 4,  20, 5,
                                                            21, 6,  22, 7,  23, 8,  24, 9,  25, 10, 26,
                                                            11, 27, 12, 28, 13, 29, 14, 30, 15, 31};
    const __m512i interleaved = _mm512_load_si512(order);
    for (int i = 0; i < width; i += 16, to += tile_values) {
        for (int j = 0; j < 16; ++j) {
            const __m512 even = 2 * j < count ? _mm512_loadu_ps(x + 2 * j * row + i) : _mm512_setzero_ps();
            const __m512 odd = 2 * j + 1 < count ? _mm512_loadu_ps(x + (2 * j + 1) * row + i) : _mm512_setzero_ps();
            _mm512_store_si512(to + j * 32, _mm512_permutexvar_epi16(interleaved, two_vectors(even, odd)));
        }
    }
}

// Tiles of to_pairs as the left operand of a sum over samples: each seen as 16×16 words, transposed.
void to_columns(const Bits* pairs, int width, Bits* to) {
    for (int i = 0; i < width; i += 16, pairs += tile_values, to += tile_values) {
        __m512i r[16], t[16];
        for (int j = 0; j < 16; ++j) r[j] = _mm512_load_si512(pairs + 32 * j);
        for (int j = 0; j < 16; j += 2) {
            t[j] = _mm512_unpacklo_epi32(r[j], r[j + 1]);
            t[j + 1] = _mm512_unpackhi_epi32(r[j], r[j + 1]);
        }
        for (int j = 0; j < 16; j += 4) {
            r[j] = _mm512_unpacklo_epi64(t[j], t[j + 2]);
            r[j + 1] = _mm512_unpackhi_epi64(t[j], t[j + 2]);
            r[j + 2] = _mm512_unpacklo_epi64(t[j + 1], t[j + 3]);
            r[j + 3] = _mm512_unpackhi_epi64(t[j + 1], t[j + 3]);
        }
        for (int j = 0; j < 4; ++j) {
            t[j] = _mm512_shuffle_i32x4(r[j], r[j + 4], 0x88);
            t[j + 4] = _mm512_shuffle_i32x4(r[j], r[j + 4], 0xdd);
            t[j + 8] = _mm512_shuffle_i32x4(r[j + 8], r[j + 12], 0x88);
            t[j + 12] = _mm512_shuffle_i32x4(r[j + 8], r[j + 12], 0xdd);
        }
        for (int j = 0; j < 4; ++j) {
            _mm512_store_si512(to + 32 * j, _mm512_shuffle_i32x4(t[j], t[j + 8], 0x88));
            _mm512_store_si512(to + 32 * (j + 8), _mm512_shuffle_i32x4(t[j], t[j + 8], 0xdd));
            _mm512_store_si512(to + 32 * (j + 4), _mm512_shuffle_i32x4(t[j + 4], t[j + 12], 0x88));
            _mm512_store_si512(to + 32 * (j + 12), _mm512_shuffle_i32x4(t[j + 4], t[j + 12], 0xdd));
        }
    }
}

// Both rows of tiles of `a` times one or two columns of tiles of b, into registers 0 to 3.
template <bool two>
void sum_tiles(const Bits* a, std::size_t a_second, std::size_t a_step, std::size_t a_bytes, const Bits* b,
               std::size_t b_second, std::size_t b_step, int steps) {
    for (int k = 0; k < steps; ++k, a += a_step, b += b_step) {
        _tile_loadd(4, a, a_bytes);
        _tile_loadd(5, a + a_second, a_bytes);
        _tile_loadd(6, b, tile_row_bytes);
        _tile_dpbf16ps(0, 4, 6);
        _tile_dpbf16ps(1, 5, 6);
        if constexpr (two) {
            _tile_loadd(7, b + b_second, tile_row_bytes);
            _tile_dpbf16ps(2, 4, 7);
            _tile_dpbf16ps(3, 5, 7);
        }
    }
}

// out (group×width, rows of `width`) = rows (group×depth) times tiles.
void multiply(const Bits* rows, int depth, const Bits* tiles, int width, float* out) {
    const std::size_t column = std::size_t(depth / 32) * tile_values, bytes = std::size_t(width) * sizeof(float);
    int i = 0;
    for (; i + 32 <= width; i += 32, tiles += 2 * column) {
        _tile_zero(0);
        _tile_zero(1);
        _tile_zero(2);
        _tile_zero(3);
        sum_tiles<true>(rows, std::size_t(16) * depth, 32, std::size_t(depth) * 2, tiles, column, tile_values,
                        depth / 32);
        _tile_stored(0, out + i, bytes);
        _tile_stored(1, out + 16 * width + i, bytes);
        _tile_stored(2, out + i + 16, bytes);
        _tile_stored(3, out + 16 * width + i + 16, bytes);
    }
    if (i == width) return;
    _tile_zero(0);
    _tile_zero(1);
    sum_tiles<false>(rows, std::size_t(16) * depth, 32, std::size_t(depth) * 2, tiles, 0, tile_values, depth / 32);
    _tile_stored(0, out + i, bytes);
    _tile_stored(1, out + 16 * width + i, bytes);
}

// grad (in×out) += Σ over samples of x and y. columns: to_columns of x, pairs: to_pairs of y, `part` apart from group
// to group.
void add_outer(const Bits* columns, int in, const Bits* pairs, int out, int count, float* grad) {
    const std::size_t bytes = std::size_t(out) * sizeof(float);
    for (int i = 0; i < in; i += 32) {
        const bool lower = i + 16 < in;  // else the second row of tiles is the first again, and is not kept
        const Bits* a = columns + i / 16 * tile_values;
        for (int o = 0; o < out; o += 32) {
            const bool two = o + 16 < out;
            const Bits* b = pairs + o / 16 * tile_values;
            float *first = grad + std::size_t(i) * out + o, *second = first + std::size_t(16) * out;
            _tile_loadd(0, first, bytes);
            if (two) _tile_loadd(2, first + 16, bytes);
            if (lower) {
                _tile_loadd(1, second, bytes);
                if (two) _tile_loadd(3, second + 16, bytes);
            }
            const std::size_t a_second = lower ? tile_values : 0;
            if (two) {
                sum_tiles<true>(a, a_second, part, tile_row_bytes, b, tile_values, part, count);
            } else {
                sum_tiles<false>(a, a_second, part, tile_row_bytes, b, 0, part, count);
            }
            _tile_stored(0, first, bytes);
            if (two) _tile_stored(2, first + 16, bytes);
            if (lower) {
                _tile_stored(1, second, bytes);
                if (two) _tile_stored(3, second + 16, bytes);
            }
        }
    }
}

// NaN stays NaN: of two operands x86's maximum returns the second if either is one.
void relu(float* x, int values) {
    for (int i = 0; i < values; i += 16) {
        _mm512_store_ps(x + i, _mm512_max_ps(_mm512_setzero_ps(), _mm512_load_ps(x + i)));
    }
}

// x where gate > 0, else 0: ReLU's derivative. The gate has `count` rows.
void gate(float* x, const float* by, int width, int count) {
    for (int i = 0; i < width * count; i += 16) {
        const __mmask16 open = _mm512_cmp_ps_mask(_mm512_loadu_ps(by + i), _mm512_setzero_ps(), _CMP_GT_OQ);
        _mm512_store_ps(x + i, _mm512_maskz_mov_ps(open, _mm512_load_ps(x + i)));
    }
}

void copy(const float* from, int values, float* to) {
    for (int i = 0; i < values; i += 16) _mm512_storeu_ps(to + i, _mm512_loadu_ps(from + i));
}

// logit_grad (3 numbers a row) times the last layer's 3×width rows; adds q's part to the layer's gradient.
void through_last(const ColorNetwork& network, const float* logit_grad, const float* q, int count, float* grad,
                  float* last_grad) {
    const int width = network.hidden;
    for (int i = 0; i < width; i += 16) {
        __m512 row[3], sum[3];
        for (int c = 0; c < 3; ++c) {
            row[c] = _mm512_loadu_ps(network.last_rows + c * width + i);
            sum[c] = _mm512_loadu_ps(last_grad + c * width + i);
        }
        for (int s = 0; s < count; ++s) {
            const __m512 value = _mm512_loadu_ps(q + s * width + i);
            __m512 back = _mm512_setzero_ps();
            for (int c = 0; c < 3; ++c) {
                const __m512 g = _mm512_set1_ps(logit_grad[3 * s + c]);
                sum[c] = _mm512_fmadd_ps(g, value, sum[c]);
                back = _mm512_fmadd_ps(g, row[c], back);
            }
            const __mmask16 open = _mm512_cmp_ps_mask(value, _mm512_setzero_ps(), _CMP_GT_OQ);
            _mm512_store_ps(grad + s * width + i, _mm512_maskz_mov_ps(open, back));
        }
        for (int c = 0; c < 3; ++c) _mm512_storeu_ps(last_grad + c * width + i, sum[c]);
    }
}

int group_size(int n, int first) {
    return n - first < group ? n - first : group;
}

}  // namespace

bool available() {
    static const bool yes = [] {
        unsigned a = 0, b = 0, c = 0, d = 0;
        if (!__get_cpuid_count(7, 0, &a, &b, &c, &d)) return false;
        const bool avx512 = (b >> 16 & 1) && (b >> 17 & 1) && (b >> 30 & 1) && (b >> 31 & 1);  // F, DQ, BW, VL
        const bool tiles = (d >> 24 & 1) && (d >> 22 & 1);                                     // AMX-TILE, AMX-BF16
        if (!__get_cpuid_count(7, 1, &a, &b, &c, &d)) return false;
        const bool bf16 = a >> 5 & 1;
        constexpr long request = 0x1023, tile_data = 18;  // ARCH_REQ_XCOMP_PERM, XFEATURE_XTILEDATA
        return avx512 && tiles && bf16 && syscall(SYS_arch_prctl, request, tile_data) == 0;
    }();
    return yes;
}

std::size_t tiles_size(int in, int out) {
    return std::size_t(deep(in)) * out;
}

void pack_tiles(const float* matrix, int in, int out, Bits* tiles) {
    for (int o = 0; o < out; o += 16) {
        for (int i = 0; i < deep(in); i += 32, tiles += tile_values) {
            for (int j = 0; j < tile_values; ++j) {
                const int from = i + j / 32 * 2 + j % 2, to = o + j % 32 / 2;
                const __m128 value = _mm_set_ss(from < in ? matrix[std::size_t(from) * out + to] : 0.0f);
                tiles[j] = static_cast<Bits>(_mm_extract_epi16((__m128i)_mm_cvtneps_pbh(value), 0));
            }
        }
    }
}

void density_forward(const DensityNetwork& w, const float* encoded, int n, float* features) {
    const Tiles tiles;
    alignas(64) Bits rows[part];
    alignas(64) float hidden[part], out[part];
    for (int first = 0; first < n; first += group) {
        const int count = group_size(n, first);
        to_rows(encoded + std::size_t(first) * w.encoded, w.encoded, w.encoded, count, rows);
        multiply(rows, deep(w.encoded), w.first, w.hidden, hidden);
        relu(hidden, group * w.hidden);
        to_rows(hidden, w.hidden, w.hidden, group, rows);
        multiply(rows, deep(w.hidden), w.second, w.features, out);
        copy(out, count * w.features, features + std::size_t(first) * w.features);
    }
}

void density_backward(const DensityNetwork& w, const float* encoded, const float* features_grad, int n,
                      float* first_grad, float* second_grad, float* encoded_grad) {
    const Tiles tiles;
    alignas(64) Bits rows[part], pairs[part];
    alignas(64) float hidden[part], grad[part], out[part];
    alignas(64) Bits encoded_columns[groups * part], hidden_columns[groups * part];
    alignas(64) Bits hidden_pairs[groups * part], feature_pairs[groups * part];
    for (int start = 0; start < n; start += groups * group) {
        int g = 0;
        for (; g < groups && start + g * group < n; ++g) {
            const int first = start + g * group, count = group_size(n, first);
            const float* e = encoded + std::size_t(first) * w.encoded;
            const float* f = features_grad + std::size_t(first) * w.features;
            to_rows(e, w.encoded, w.encoded, count, rows);
            multiply(rows, deep(w.encoded), w.first, w.hidden, hidden);
            relu(hidden, group * w.hidden);
            to_rows(f, w.features, w.features, count, rows);
            multiply(rows, deep(w.features), w.second_back, w.hidden, grad);
            gate(grad, hidden, w.hidden, group);
            to_rows(grad, w.hidden, w.hidden, group, rows);
            multiply(rows, deep(w.hidden), w.first_back, w.encoded, out);
            copy(out, count * w.encoded, encoded_grad + std::size_t(first) * w.encoded);
            to_pairs(e, w.encoded, w.encoded, count, pairs);
            to_columns(pairs, w.encoded, encoded_columns + g * part);
            to_pairs(hidden, w.hidden, w.hidden, group, pairs);
            to_columns(pairs, w.hidden, hidden_columns + g * part);
            to_pairs(grad, w.hidden, w.hidden, group, hidden_pairs + g * part);
            to_pairs(f, w.features, w.features, count, feature_pairs + g * part);
        }
        add_outer(encoded_columns, w.encoded, hidden_pairs, w.hidden, g, first_grad);
        add_outer(hidden_columns, w.hidden, feature_pairs, w.features, g, second_grad);
    }
}

void color_forward(const ColorNetwork& w, const float* features, const std::int32_t* ray, const float* base, int n,
                   float* hidden0, float* hidden1, float* logits) {
    const Tiles tiles;
    alignas(64) Bits rows[part];
    alignas(64) float out[part];
    for (int first = 0; first < n; first += group) {
        const int count = group_size(n, first);
        float* p = hidden0 + std::size_t(first) * w.hidden;
        float* q = hidden1 + std::size_t(first) * w.hidden;
        to_rows(features + std::size_t(first) * w.features, w.features, w.features, count, rows);
        multiply(rows, deep(w.features), w.first, w.hidden, out);
        for (int s = 0; s < count; ++s) {
            const float* more = base + std::size_t(ray[first + s]) * w.hidden;
            for (int i = 0; i < w.hidden; i += 16) {
                const __m512 sum = _mm512_add_ps(_mm512_load_ps(out + s * w.hidden + i), _mm512_loadu_ps(more + i));
                _mm512_storeu_ps(p + s * w.hidden + i, _mm512_max_ps(_mm512_setzero_ps(), sum));
            }
        }
        to_rows(p, w.hidden, w.hidden, count, rows);
        multiply(rows, deep(w.hidden), w.second, w.hidden, out);
        relu(out, count * w.hidden);
        copy(out, count * w.hidden, q);
        to_rows(out, w.hidden, w.hidden, count, rows);
        multiply(rows, deep(w.hidden), w.last, 16, out);
        for (int s = 0; s < count; ++s) {
            for (int c = 0; c < 3; ++c) logits[std::size_t(first + s) * 3 + c] = out[16 * s + c];
        }
    }
}

void color_backward(const ColorNetwork& w, const float* features, const std::int32_t* ray, const float* hidden0,
                    const float* hidden1, const float* logit_grad, int n, float* first_grad, float* second_grad,
                    float* last_grad, float* base_grad, float* features_grad) {
    const Tiles tiles;
    alignas(64) Bits rows[part], pairs[part];
    alignas(64) float grad1[part], grad0[part], out[part];
    alignas(64) Bits hidden_columns[groups * part], feature_columns[groups * part];
    alignas(64) Bits grad1_pairs[groups * part], grad0_pairs[groups * part];
    for (int start = 0; start < n; start += groups * group) {
        int g = 0;
        for (; g < groups && start + g * group < n; ++g) {
            const int first = start + g * group, count = group_size(n, first);
            const float* f = features + std::size_t(first) * w.features;
            const float* p = hidden0 + std::size_t(first) * w.hidden;
            through_last(w, logit_grad + std::size_t(first) * 3, hidden1 + std::size_t(first) * w.hidden, count, grad1,
                         last_grad);
            to_rows(grad1, w.hidden, w.hidden, count, rows);
            multiply(rows, deep(w.hidden), w.second_back, w.hidden, grad0);
            gate(grad0, p, w.hidden, count);
            for (int s = 0; s < count; ++s) {
                float* to = base_grad + std::size_t(ray[first + s]) * w.hidden;
                for (int i = 0; i < w.hidden; i += 16) {
                    const __m512 more = _mm512_load_ps(grad0 + s * w.hidden + i);
                    _mm512_storeu_ps(to + i, _mm512_add_ps(_mm512_loadu_ps(to + i), more));
                }
            }
            to_rows(grad0, w.hidden, w.hidden, count, rows);
            multiply(rows, deep(w.hidden), w.first_back, w.features, out);
            copy(out, count * w.features, features_grad + std::size_t(first) * w.features);
            to_pairs(p, w.hidden, w.hidden, count, pairs);
            to_columns(pairs, w.hidden, hidden_columns + g * part);
            to_pairs(f, w.features, w.features, count, pairs);
            to_columns(pairs, w.features, feature_columns + g * part);
            to_pairs(grad1, w.hidden, w.hidden, count, grad1_pairs + g * part);
            to_pairs(grad0, w.hidden, w.hidden, count, grad0_pairs + g * part);
        }
        add_outer(hidden_columns, w.hidden, grad1_pairs, w.hidden, g, second_grad);
        add_outer(feature_columns, w.features, grad0_pairs, w.hidden, g, first_grad);
    }
}

}  // namespace fieldgraft::amx

#else  // another kind of machine: never called, as nothing is available

namespace fieldgraft::amx {

bool available() {
    return false;
}
std::size_t tiles_size(int, int) {
    return 0;
}
void pack_tiles(const float*, int, int, std::uint16_t*) {}
void density_forward(const DensityNetwork&, const float*, int, float*) {}
void density_backward(const DensityNetwork&, const float*, const float*, int, float*, float*, float*) {}
void color_forward(const ColorNetwork&, const float*, const std::int32_t*, const float*, int, float*, float*, float*) {}
void color_backward(const ColorNetwork&, const float*, const std::int32_t*, const float*, const float*, const float*,
                    int, float*, float*, float*, float*, float*) {}

}  // namespace fieldgraft::amx

#endif
