#include "core/kernels/hash_grid_simd.h"

#include <algorithm>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <vector>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/hash_grid_simd.cpp"
#include "core/kernels/simd_targets.h"

HWY_BEFORE_NAMESPACE();
namespace fieldgraft {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::uint32_t prime_y = 2654435761u, prime_z = 805459861u;
constexpr std::size_t group = 16;    // samples whose corners are found together
constexpr std::size_t block = 8192;  // samples between two changes of level
constexpr std::size_t lanes = HWY_LANES(float);
static_assert(group % lanes == 0);

using Floats = hn::ScalableTag<float>;
using Ints = hn::ScalableTag<std::int32_t>;
using Words = hn::ScalableTag<std::uint32_t>;

// The cells of a group of samples, the entry numbers of their eight corners, and where in its cell each sample is.
struct Corners {
    HWY_ALIGN std::uint32_t cell[3][group];
    HWY_ALIGN std::uint32_t entry[8][group];
    HWY_ALIGN float fraction[3][group + lanes];  // room to read a whole vector anywhere
};

template <bool dense>
HWY_INLINE void find_corners(const HashGridLevel& level, const float* x, const float* y, const float* z, Corners& out) {
    const Floats df;
    const Ints di;
    const Words dw;
    const auto resolution = hn::Set(df, static_cast<float>(level.resolution)), zero = hn::Zero(df);
    const auto last = hn::Set(di, level.resolution - 1);
    const auto one = hn::Set(dw, 1u);
    const std::uint32_t side = static_cast<std::uint32_t>(level.resolution) + 1;
    const auto step_y = hn::Set(dw, dense ? side : prime_y), step_z = hn::Set(dw, dense ? side * side : prime_z);
    const auto mask = hn::Set(dw, level.entries - 1);
    for (std::size_t i = 0; i < group; i += lanes) {
        hn::Vec<Words> cell[3];
        const float* axes[3] = {x + i, y + i, z + i};
        for (int a = 0; a < 3; ++a) {
            // NaN fails the comparison and lands in cell 0.
            const auto scaled = hn::Mul(hn::LoadU(df, axes[a]), resolution);
            const auto bounded = hn::Min(hn::IfThenElseZero(hn::Gt(scaled, zero), scaled), resolution);
            const auto lower = hn::Min(hn::ConvertTo(di, bounded), last);
            hn::Store(hn::Sub(bounded, hn::ConvertTo(df, lower)), df, out.fraction[a] + i);
            cell[a] = hn::BitCast(dw, lower);
            hn::Store(cell[a], dw, out.cell[a] + i);
        }
        const auto y0 = hn::Mul(cell[1], step_y), y1 = hn::Add(y0, step_y);
        const auto z0 = hn::Mul(cell[2], step_z), z1 = hn::Add(z0, step_z);
        const auto x1 = hn::Add(cell[0], one);
        const auto join = [&](auto a, auto b) HWY_ATTR {
            if constexpr (dense) {
                return hn::Add(a, b);
            } else {
                return hn::Xor(a, b);
            }
        };
        const hn::Vec<Words> rest[4] = {join(y0, z0), join(y1, z0), join(y0, z1), join(y1, z1)};
        for (int c = 0; c < 4; ++c) {
            auto low = join(rest[c], cell[0]), high = join(rest[c], x1);
            if constexpr (!dense) {
                low = hn::And(low, mask);
                high = hn::And(high, mask);
            }
            hn::Store(low, dw, out.entry[2 * c] + i);
            hn::Store(high, dw, out.entry[2 * c + 1] + i);
        }
    }
}

HWY_INLINE void find_group(const HashGridLevel& level, const float* positions, std::size_t n, std::size_t first,
                           Corners& corners) {
    const float* x = positions + first;
    HWY_ALIGN float rest[3][group];
    const std::size_t count = std::min(group, n - first);
    const float* axes[3] = {x, x + n, x + 2 * n};
    if (count < group) {  // the last group is filled up
        for (int a = 0; a < 3; ++a) {
            for (std::size_t i = 0; i < group; ++i) rest[a][i] = i < count ? axes[a][i] : 0.0f;
            axes[a] = rest[a];
        }
    }
    if (level.dense) {
        find_corners<true>(level, axes[0], axes[1], axes[2], corners);
    } else {
        find_corners<false>(level, axes[0], axes[1], axes[2], corners);
    }
}

// On their way while another group is worked on: a fine level's table lies further away than the first-level cache.
template <std::size_t features>
HWY_INLINE void prefetch(const float* entries, const Corners& corners) {
    for (const auto& corner : corners.entry) {
        for (std::size_t i = 0; i < group; ++i) __builtin_prefetch(entries + std::size_t{corner[i]} * features);
    }
}

using Pairs = hn::Repartition<double, Floats>;
constexpr std::size_t pairs = lanes / 2;

// Entries (two floats each) of `pairs` samples side by side.
HWY_INLINE hn::Vec<Floats> load_pairs(const float* entries, const std::uint32_t* entry) {
    const hn::Rebind<std::int64_t, Pairs> wide;
    const hn::Rebind<std::int32_t, Pairs> narrow;
    const auto index = hn::PromoteTo(wide, hn::LoadU(narrow, reinterpret_cast<const std::int32_t*>(entry)));
    return hn::BitCast(Floats(), hn::GatherIndex(Pairs(), reinterpret_cast<const double*>(entries), index));
}

// values[i] twice each, for i = 0 … pairs − 1; reads a whole vector.
HWY_INLINE hn::Vec<Floats> doubled(const float* values) {
    const Floats df;
    HWY_ALIGN static constexpr std::int32_t twice[16] = {0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7};
    return hn::TableLookupLanes(hn::LoadU(df, values), hn::SetTableIndices(df, twice));
}

// One level of n samples; out: n pairs.
void encode_level(const HashGridLevel& level, const float* entries, const float* positions, std::size_t n,
                  std::size_t first, std::size_t count, float* out) {
    const Floats df;
    Corners buffers[2];
    const auto one = hn::Set(df, 1.0f);
    int turn = 0;
    find_group(level, positions, n, first, buffers[0]);
    for (std::size_t g = 0; g < count; g += group, turn ^= 1) {
        const Corners& corners = buffers[turn];
        if (g + group < count) {
            find_group(level, positions, n, first + g + group, buffers[turn ^ 1]);
            if (!level.dense) prefetch<2>(entries, buffers[turn ^ 1]);
        }
        for (std::size_t i = 0; i < group; i += pairs) {
            const auto fx = doubled(corners.fraction[0] + i), fy = doubled(corners.fraction[1] + i),
                       fz = doubled(corners.fraction[2] + i);
            const auto gx = hn::Sub(one, fx), gy = hn::Sub(one, fy), gz = hn::Sub(one, fz);
            const hn::Vec<Floats> area[4] = {hn::Mul(gy, gz), hn::Mul(fy, gz), hn::Mul(gy, fz), hn::Mul(fy, fz)};
            auto sum = hn::Zero(df);
            for (int c = 0; c < 4; ++c) {
                const auto low = load_pairs(entries, corners.entry[2 * c] + i);
                const auto high = load_pairs(entries, corners.entry[2 * c + 1] + i);
                sum = hn::MulAdd(area[c], hn::MulAdd(fx, high, hn::Mul(gx, low)), sum);
            }
            hn::StoreU(sum, df, out + 2 * (g + i));
        }
    }
}

void encode(const HashGrid& grid, const float* table, const float* positions, std::size_t n, float* encoded,
            std::size_t row) {
    const std::size_t levels = grid.levels.size();
    const auto part = std::make_unique_for_overwrite<float[]>(levels * 2 * (std::min(block, n) + group));
    for (std::size_t first = 0; first < n; first += block) {
        const std::size_t count = std::min(block, n - first), stride = 2 * (count + group);
        for (std::size_t l = 0; l < levels; ++l) {
            encode_level(grid.levels[l], table + 2 * grid.levels[l].offset, positions, n, first, count,
                         part.get() + l * stride);
        }
        for (std::size_t s = 0; s < count; ++s) {
            float* to = encoded + (first + s) * row;
            for (std::size_t l = 0; l < levels; ++l) std::memcpy(to + 2 * l, part.get() + l * stride + 2 * s, 8);
            std::fill(to + 2 * levels, to + row, 0.0f);
        }
    }
}

// Four features: an entry is a vector of its own, and a level of n samples is written where it belongs.
using Quad = hn::FixedTag<float, 4>;

void encode_level_of_four(const HashGridLevel& level, const float* entries, const float* positions, std::size_t n,
                          float* out, std::size_t row) {
    const Quad d;
    Corners buffers[2];
    int turn = 0;
    find_group(level, positions, n, 0, buffers[0]);
    for (std::size_t first = 0; first < n; first += group, turn ^= 1) {
        const Corners& corners = buffers[turn];
        if (first + group < n) {
            find_group(level, positions, n, first + group, buffers[turn ^ 1]);
            if (!level.dense) prefetch<4>(entries, buffers[turn ^ 1]);
        }
        const std::size_t count = std::min(group, n - first);
        for (std::size_t i = 0; i < count; ++i) {
            const float x = corners.fraction[0][i], y = corners.fraction[1][i], z = corners.fraction[2][i];
            const auto fx = hn::Set(d, x), gx = hn::Set(d, 1 - x);
            const float area[4] = {(1 - y) * (1 - z), y * (1 - z), (1 - y) * z, y * z};
            auto sum = hn::Zero(d);
            for (int c = 0; c < 4; ++c) {
                const auto low = hn::LoadU(d, entries + std::size_t{corners.entry[2 * c][i]} * 4);
                const auto high = hn::LoadU(d, entries + std::size_t{corners.entry[2 * c + 1][i]} * 4);
                sum = hn::MulAdd(hn::Set(d, area[c]), hn::MulAdd(fx, high, hn::Mul(gx, low)), sum);
            }
            hn::StoreU(sum, d, out + (first + i) * row);
        }
    }
}

void encode_four(const HashGrid& grid, const float* table, const float* positions, std::size_t n, float* encoded,
                 std::size_t row) {
    const std::size_t width = grid.rows();
    for (std::size_t l = 0; l < grid.levels.size(); ++l)
        encode_level_of_four(grid.levels[l], table + 4 * grid.levels[l].offset, positions, n, encoded + 4 * l, row);
    for (std::size_t s = 0; s < n && width < row; ++s)
        std::fill(encoded + s * row + width, encoded + (s + 1) * row, 0.0f);
}

// The gradients of one cell's eight corners, two features each: 16 floats.
constexpr std::size_t parts = 16 / lanes;

void add_gradient(const HashGridLevel& level, const HashGridRows& rows, int number, float* grad) {
    const Floats df;
    HWY_ALIGN static constexpr float sign[3][16] = {
        {-1, -1, 1, 1, -1, -1, 1, 1, -1, -1, 1, 1, -1, -1, 1, 1},
        {-1, -1, -1, -1, 1, 1, 1, 1, -1, -1, -1, -1, 1, 1, 1, 1},
        {-1, -1, -1, -1, -1, -1, -1, -1, 1, 1, 1, 1, 1, 1, 1, 1},
    };
    HWY_ALIGN static constexpr float start[3][16] = {
        {1, 1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0},
        {1, 1, 1, 1, 0, 0, 0, 0, 1, 1, 1, 1, 0, 0, 0, 0},
        {1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0},
    };
    hn::Vec<Floats> sum[parts], signs[3][parts], starts[3][parts];
    for (std::size_t p = 0; p < parts; ++p) {
        sum[p] = hn::Zero(df);
        for (int a = 0; a < 3; ++a) {
            signs[a][p] = hn::Load(df, sign[a] + p * lanes);
            starts[a][p] = hn::Load(df, start[a] + p * lanes);
        }
    }
    if (rows.n == 0) return;
    const float* gradients = rows.encoded_grad + static_cast<std::size_t>(number) * rows.level_step;
    Corners buffers[2];
    HWY_ALIGN float sums[16];
    // Where the sums belong; nothing has been summed yet.
    std::uint32_t entry[8] = {}, cell[3] = {~0u, ~0u, ~0u};
    const auto flush = [&]() HWY_ATTR {
        for (std::size_t p = 0; p < parts; ++p) {
            hn::Store(sum[p], df, sums + p * lanes);
            sum[p] = hn::Zero(df);
        }
        for (int c = 0; c < 8; ++c) {
            typedef float Pair __attribute__((vector_size(8)));
            Pair value, more;
            float* place = grad + std::size_t{entry[c]} * 2;
            std::memcpy(&value, place, 8);
            std::memcpy(&more, sums + 2 * c, 8);
            value += more;
            std::memcpy(place, &value, 8);
        }
    };
    int turn = 0;
    find_group(level, rows.positions, rows.n, 0, buffers[0]);
    for (std::size_t first = 0; first < rows.n; first += group, turn ^= 1) {
        const Corners& now = buffers[turn];
        if (first + group < rows.n) {
            find_group(level, rows.positions, rows.n, first + group, buffers[turn ^ 1]);
            if (!level.dense) prefetch<2>(grad, buffers[turn ^ 1]);
        }
        const std::size_t count = std::min(group, rows.n - first);
        for (std::size_t i = 0; i < count; ++i) {
            const std::uint32_t moved =
                (now.cell[0][i] ^ cell[0]) | (now.cell[1][i] ^ cell[1]) | (now.cell[2][i] ^ cell[2]);
            if (moved != 0) {
                flush();
                for (int c = 0; c < 8; ++c) entry[c] = now.entry[c][i];
                for (int a = 0; a < 3; ++a) cell[a] = now.cell[a][i];
            }
            double both;
            std::memcpy(&both, gradients + (first + i) * rows.row, 8);
            const auto g = hn::BitCast(df, hn::Set(Pairs(), both));
            const auto fx = hn::Set(df, now.fraction[0][i]), fy = hn::Set(df, now.fraction[1][i]),
                       fz = hn::Set(df, now.fraction[2][i]);
            for (std::size_t p = 0; p < parts; ++p) {
                const auto weight = hn::Mul(
                    hn::Mul(hn::MulAdd(fx, signs[0][p], starts[0][p]), hn::MulAdd(fy, signs[1][p], starts[1][p])),
                    hn::MulAdd(fz, signs[2][p], starts[2][p]));
                sum[p] = hn::MulAdd(weight, g, sum[p]);
            }
        }
    }
    flush();
}

// The same with four features: runs of samples in one cell are summed in eight vectors.
void add_gradient_of_four(const HashGridLevel& level, const HashGridRows& rows, int number, float* grad) {
    if (rows.n == 0) return;
    const Quad d;
    const float* gradients = rows.encoded_grad + static_cast<std::size_t>(number) * rows.level_step;
    Corners buffers[2];
    hn::Vec<Quad> sum[8];
    for (auto& s : sum) s = hn::Zero(d);
    std::uint32_t entry[8] = {}, cell[3] = {~0u, ~0u, ~0u};
    const auto flush = [&]() HWY_ATTR {
        for (int c = 0; c < 8; ++c) {
            float* place = grad + std::size_t{entry[c]} * 4;
            hn::StoreU(hn::Add(hn::LoadU(d, place), sum[c]), d, place);
            sum[c] = hn::Zero(d);
        }
    };
    int turn = 0;
    find_group(level, rows.positions, rows.n, 0, buffers[0]);
    for (std::size_t first = 0; first < rows.n; first += group, turn ^= 1) {
        const Corners& now = buffers[turn];
        if (first + group < rows.n) {
            find_group(level, rows.positions, rows.n, first + group, buffers[turn ^ 1]);
            if (!level.dense) prefetch<4>(grad, buffers[turn ^ 1]);
        }
        const std::size_t count = std::min(group, rows.n - first);
        for (std::size_t i = 0; i < count; ++i) {
            if (((now.cell[0][i] ^ cell[0]) | (now.cell[1][i] ^ cell[1]) | (now.cell[2][i] ^ cell[2])) != 0) {
                flush();
                for (int c = 0; c < 8; ++c) entry[c] = now.entry[c][i];
                for (int a = 0; a < 3; ++a) cell[a] = now.cell[a][i];
            }
            const float x = now.fraction[0][i], y = now.fraction[1][i], z = now.fraction[2][i];
            const auto g = hn::LoadU(d, gradients + (first + i) * rows.row);
            const auto high = hn::Mul(g, hn::Set(d, x)), low = hn::Mul(g, hn::Set(d, 1 - x));
            const float area[4] = {(1 - y) * (1 - z), y * (1 - z), (1 - y) * z, y * z};
            for (int c = 0; c < 4; ++c) {
                const auto a = hn::Set(d, area[c]);
                sum[2 * c] = hn::MulAdd(a, low, sum[2 * c]);
                sum[2 * c + 1] = hn::MulAdd(a, high, sum[2 * c + 1]);
            }
        }
    }
    flush();
}

}  // namespace HWY_NAMESPACE
}  // namespace fieldgraft
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fieldgraft {
namespace {

constexpr std::size_t reference_chunk = 2048;

// count samples from `first` on, as the reference wants them: 3×count.
std::vector<float> columns(const float* positions, std::size_t n, std::size_t first, std::size_t count) {
    std::vector<float> part(3 * count);
    for (std::size_t a = 0; a < 3; ++a) std::copy_n(positions + a * n + first, count, part.data() + a * count);
    return part;
}

void encode_with_reference(const HashGrid& grid, std::span<const float> table, const float* positions, std::size_t n,
                           float* encoded, std::size_t row) {
    for (std::size_t first = 0; first < n; first += reference_chunk) {
        const std::size_t count = std::min(reference_chunk, n - first);
        std::vector<float> part(grid.rows() * count);
        hash_grid_forward<float>(grid, table, columns(positions, n, first, count), part);
        for (std::size_t s = 0; s < count; ++s) {
            float* to = encoded + (first + s) * row;
            for (std::size_t i = 0; i < row; ++i) to[i] = i < grid.rows() ? part[i * count + s] : 0.0f;
        }
    }
}

void add_gradient_with_reference(const HashGrid& grid, int level, const HashGridRows& rows, float* level_grad) {
    const std::size_t features = static_cast<std::size_t>(grid.features);
    HashGrid one{grid.features, {grid.levels[level]}, grid.levels[level].entries};
    one.levels[0].offset = 0;
    for (std::size_t first = 0; first < rows.n; first += reference_chunk) {
        const std::size_t count = std::min(reference_chunk, rows.n - first);
        const std::vector<float> positions = columns(rows.positions, rows.n, first, count);
        std::vector<float> grads(features * count);
        for (std::size_t s = 0; s < count; ++s) {
            for (std::size_t f = 0; f < features; ++f) {
                grads[f * count + s] = rows.encoded_grad[level * rows.level_step + (first + s) * rows.row + f];
            }
        }
        const HashGridChunk<float> chunk{positions, grads};
        hash_grid_backward<float>(one, {&chunk, 1}, {level_grad, one.entries * features}, serial_for);
    }
}

}  // namespace

HWY_EXPORT(encode);
HWY_EXPORT(encode_four);
HWY_EXPORT(add_gradient);
HWY_EXPORT(add_gradient_of_four);

void hash_grid_encode(const HashGrid& grid, std::span<const float> table, const float* positions, std::size_t n,
                      float* encoded, std::size_t row) {
    if (table.size() != grid.entries * grid.features || row < grid.rows()) {
        throw std::invalid_argument("hash grid: the table or the row has another size than the levels");
    }
    if (grid.features == 2) {
        HWY_DYNAMIC_DISPATCH(encode)(grid, table.data(), positions, n, encoded, row);
    } else if (grid.features == 4) {
        HWY_DYNAMIC_DISPATCH(encode_four)(grid, table.data(), positions, n, encoded, row);
    } else {
        encode_with_reference(grid, table, positions, n, encoded, row);
    }
}

void hash_grid_add_gradient(const HashGrid& grid, int level, std::span<const HashGridRows> parts, float* level_grad) {
    for (const HashGridRows& rows : parts) {
        if (grid.features == 2) {
            HWY_DYNAMIC_DISPATCH(add_gradient)(grid.levels[level], rows, level, level_grad);
        } else if (grid.features == 4) {
            HWY_DYNAMIC_DISPATCH(add_gradient_of_four)(grid.levels[level], rows, level, level_grad);
        } else {
            add_gradient_with_reference(grid, level, rows, level_grad);
        }
    }
}

}  // namespace fieldgraft
#endif  // HWY_ONCE
