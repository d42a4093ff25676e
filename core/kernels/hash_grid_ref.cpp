#include "core/kernels/hash_grid_ref.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string>

namespace fieldgraft {
namespace {

constexpr std::uint32_t prime_y = 2654435761u;
constexpr std::uint32_t prime_z = 805459861u;
constexpr int group = 32;  // points whose corners are found together, so that their loads can be prefetched

// The eight corners of a group of points: entry numbers and trilinear weights.
template <class T>
struct Corners {
    std::array<std::array<std::uint32_t, group>, 8> entry;
    std::array<std::array<T, group>, 8> weight;
};

template <class T>
inline void axis_cell(T position, int resolution, std::uint32_t& cell, T& fraction) {
    // NaN fails both comparisons of the clamp's first half and lands in cell 0.
    const T scaled = position * static_cast<T>(resolution);
    const T bounded =
        scaled > T(0) ? (scaled < static_cast<T>(resolution) ? scaled : static_cast<T>(resolution)) : T(0);
    const int lower = std::min(static_cast<int>(bounded), resolution - 1);
    cell = static_cast<std::uint32_t>(lower);
    fraction = bounded - static_cast<T>(lower);
}

template <class T, bool dense>
void find_corners(const HashGridLevel& level, const T* __restrict x, const T* __restrict y, const T* __restrict z,
                  int count, Corners<T>& __restrict corners) {
    const int resolution = level.resolution;  // a copy: what is written below cannot change it, so the loop vectorises
    const std::uint32_t side = static_cast<std::uint32_t>(resolution) + 1;
    const std::uint32_t mask = level.entries - 1;
    for (int i = 0; i < count; ++i) {
        std::uint32_t cx, cy, cz;
        T fx, fy, fz;
        axis_cell(x[i], resolution, cx, fx);
        axis_cell(y[i], resolution, cy, fy);
        axis_cell(z[i], resolution, cz, fz);
        const std::uint32_t y0 = dense ? cy * side : cy * prime_y, y1 = y0 + (dense ? side : prime_y);
        const std::uint32_t z0 = dense ? cz * side * side : cz * prime_z, z1 = z0 + (dense ? side * side : prime_z);
        const std::array<std::uint32_t, 4> rest{dense ? y0 + z0 : y0 ^ z0, dense ? y1 + z0 : y1 ^ z0,
                                                dense ? y0 + z1 : y0 ^ z1, dense ? y1 + z1 : y1 ^ z1};
        const std::array<T, 4> area{(1 - fy) * (1 - fz), fy * (1 - fz), (1 - fy) * fz, fy * fz};
        for (int c = 0; c < 4; ++c) {
            corners.entry[2 * c][i] = dense ? rest[c] + cx : (rest[c] ^ cx) & mask;
            corners.entry[2 * c + 1][i] = dense ? rest[c] + cx + 1 : (rest[c] ^ (cx + 1)) & mask;
            corners.weight[2 * c][i] = area[c] * (1 - fx);
            corners.weight[2 * c + 1][i] = area[c] * fx;
        }
    }
}

template <class T>
void find_group(const HashGridLevel& level, std::span<const T> positions, std::size_t first, int count,
                Corners<T>& corners) {
    const std::size_t n = positions.size() / 3;
    const T* x = positions.data() + first;
    if (level.dense) {
        find_corners<T, true>(level, x, x + n, x + 2 * n, count, corners);
    } else {
        find_corners<T, false>(level, x, x + n, x + 2 * n, count, corners);
    }
}

// Calls use(first, count, corners) for every group of a level, with the next group's entries already on their way.
template <class T, class Use>
void for_each_group(const HashGridLevel& level, std::span<const T> positions, const T* entries, int features, Use use) {
    const std::size_t n = positions.size() / 3;
    Corners<T> buffers[2];
    int now = 0;
    if (n > 0) find_group(level, positions, 0, static_cast<int>(std::min<std::size_t>(group, n)), buffers[now]);
    for (std::size_t first = 0; first < n; first += group, now ^= 1) {
        const int count = static_cast<int>(std::min<std::size_t>(group, n - first));
        const std::size_t next = first + group;
        if (next < n) {
            const int ahead = static_cast<int>(std::min<std::size_t>(group, n - next));
            find_group(level, positions, next, ahead, buffers[now ^ 1]);
            for (const auto& corner : buffers[now ^ 1].entry) {
                for (int i = 0; i < ahead; ++i) __builtin_prefetch(entries + std::size_t{corner[i]} * features);
            }
        }
        use(first, count, buffers[now]);
    }
}

// An entry's features in one register where their number allows it.
template <class T, int F>
struct Entry {
    static constexpr bool packed = (F & (F - 1)) == 0;
    typedef T Vector __attribute__((vector_size(sizeof(T) * (packed ? F : 1))));
    Vector values[packed ? 1 : F] = {};

    static Entry load(const T* from) {
        Entry entry;
        std::memcpy(&entry.values, from, sizeof(T) * F);
        return entry;
    }
    void store(T* to) const { std::memcpy(to, &values, sizeof(T) * F); }
    void add(T weight, const Entry& other) {
        for (std::size_t i = 0; i < std::size(values); ++i) values[i] += weight * other.values[i];
    }
    T operator[](int f) const { return packed ? values[0][f] : values[packed ? 0 : f][0]; }
};

template <class T, int F>
void forward_level(const HashGridLevel& level, const T* entries, std::span<const T> positions, T* rows) {
    const std::size_t n = positions.size() / 3;
    for_each_group<T>(level, positions, entries, F, [&](std::size_t first, int count, const Corners<T>& corners) {
        for (int i = 0; i < count; ++i) {
            Entry<T, F> sum;
            for (int c = 0; c < 8; ++c) {
                const T* entry = entries + std::size_t{corners.entry[c][i]} * F;
                sum.add(corners.weight[c][i], Entry<T, F>::load(entry));
            }
            for (int f = 0; f < F; ++f) rows[f * n + first + i] = sum[f];
        }
    });
}

template <class T, int F>
void backward_level(const HashGridLevel& level, std::span<const T> positions, const T* rows, T* entries) {
    const std::size_t n = positions.size() / 3;
    for_each_group<T>(level, positions, entries, F, [&](std::size_t first, int count, const Corners<T>& corners) {
        for (int i = 0; i < count; ++i) {
            T features[F];
            for (int f = 0; f < F; ++f) features[f] = rows[f * n + first + i];
            const Entry<T, F> grad = Entry<T, F>::load(features);
            for (int c = 0; c < 8; ++c) {
                T* place = entries + std::size_t{corners.entry[c][i]} * F;
                Entry<T, F> entry = Entry<T, F>::load(place);
                entry.add(corners.weight[c][i], grad);
                entry.store(place);
            }
        }
    });
}

// Calls body with the number of features as a compile-time constant.
template <class Body>
void with_features(int features, Body body) {
    switch (features) {
        case 1:
            return body(std::integral_constant<int, 1>{});
        case 2:
            return body(std::integral_constant<int, 2>{});
        case 3:
            return body(std::integral_constant<int, 3>{});
        case 4:
            return body(std::integral_constant<int, 4>{});
        case 5:
            return body(std::integral_constant<int, 5>{});
        case 6:
            return body(std::integral_constant<int, 6>{});
        case 7:
            return body(std::integral_constant<int, 7>{});
        case 8:
            return body(std::integral_constant<int, 8>{});
    }
    throw std::invalid_argument("features per level must be 1 to 8, not " + std::to_string(features));
}

void require(bool holds, const std::string& what) {
    if (!holds) throw std::invalid_argument("hash grid: " + what);
}

}  // namespace

HashGrid make_hash_grid(int levels, int features, int log2_table_size, int base, int finest) {
    require(levels >= 1 && levels <= 64, "levels must be 1 to 64, not " + std::to_string(levels));
    require(features >= 1 && features <= 8, "features per level must be 1 to 8, not " + std::to_string(features));
    require(log2_table_size >= 1 && log2_table_size <= 28,
            "log2 of the table size must be 1 to 28, not " + std::to_string(log2_table_size));
    require(base >= 1 && base <= finest && finest <= 1 << 20,
            "resolutions must obey 1 <= base <= finest <= 2^20, not " + std::to_string(base) + " and " +
                std::to_string(finest));
    HashGrid grid;
    grid.features = features;
    const double growth = levels > 1 ? std::exp(std::log(double(finest) / base) / (levels - 1)) : 1.0;
    const std::uint64_t capacity = std::uint64_t{1} << log2_table_size;
    for (int l = 0; l < levels; ++l) {
        HashGridLevel level;
        // The small term keeps rounding of the power from losing a cell of the last level.
        level.resolution = static_cast<int>(std::floor(base * std::pow(growth, l) + 1e-6));
        const std::uint64_t side = static_cast<std::uint64_t>(level.resolution) + 1;
        level.dense = side * side * side <= capacity;
        level.entries = static_cast<std::uint32_t>(level.dense ? side * side * side : capacity);
        level.offset = grid.entries;
        grid.entries += level.entries;
        grid.levels.push_back(level);
    }
    return grid;
}

template <class T>
void hash_grid_forward(const HashGrid& grid, std::span<const T> table, std::span<const T> positions,
                       std::span<T> encoded) {
    const std::size_t n = positions.size() / 3;
    require(positions.size() == 3 * n && encoded.size() == grid.rows() * n, "positions and features do not match");
    require(table.size() == grid.entries * grid.features, "the table has another size than its levels");
    with_features(grid.features, [&](auto features) {
        for (std::size_t l = 0; l < grid.levels.size(); ++l) {
            const auto& level = grid.levels[l];
            forward_level<T, features>(level, table.data() + level.offset * features, positions,
                                       encoded.data() + l * features * n);
        }
    });
}

template <class T>
void hash_grid_backward(const HashGrid& grid, std::span<const HashGridChunk<T>> chunks, std::span<T> table_grad,
                        const ParallelFor& parallel_for) {
    require(table_grad.size() == grid.entries * grid.features, "the table's gradient has another size than its levels");
    for (const auto& chunk : chunks) {
        require(chunk.encoded_grad.size() * 3 == grid.rows() * chunk.positions.size(),
                "positions and gradients do not match");
    }
    // Fine levels miss the cache and cost more: deal them out so that two contiguous halves are alike.
    const std::int64_t count = static_cast<std::int64_t>(grid.levels.size());
    std::vector<std::size_t> order;
    for (std::int64_t l = 0; l < count; l += 2) order.push_back(l);
    for (std::int64_t l = 1; l < count; l += 2) order.push_back(l);
    parallel_for(count, 1, [&](std::int64_t begin, std::int64_t end) {
        with_features(grid.features, [&](auto features) {
            for (std::int64_t i = begin; i < end; ++i) {
                const auto& level = grid.levels[order[i]];
                for (const auto& chunk : chunks) {
                    const T* rows = chunk.encoded_grad.data() + order[i] * features * (chunk.positions.size() / 3);
                    backward_level<T, features>(level, chunk.positions, rows,
                                                table_grad.data() + level.offset * features);
                }
            }
        });
    });
}

#define FIELDGRAFT_INSTANTIATE(T)                                                                              \
    template void hash_grid_forward<T>(const HashGrid&, std::span<const T>, std::span<const T>, std::span<T>); \
    template void hash_grid_backward<T>(const HashGrid&, std::span<const HashGridChunk<T>>, std::span<T>,      \
                                        const ParallelFor&);
FIELDGRAFT_INSTANTIATE(float)
FIELDGRAFT_INSTANTIATE(double)
#undef FIELDGRAFT_INSTANTIATE

}  // namespace fieldgraft
