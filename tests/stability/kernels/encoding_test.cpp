// The hash encoding and the gradient of its table against 50 digits, written from the definition (hash_grid_ref.h).
#include <gtest/gtest.h>

#include "core/kernels/hash_grid_simd.h"
#include "tests/kernels/numeric.h"
#include "tests/kernels/simd_targets.h"
#include "tests/stability/big.h"
#include "tests/stability/ledger.h"

namespace fieldgraft::stability {
namespace {

constexpr const char* quantity = "hash encoding";

// The eight corners of a point in a level: entries and weights.
struct Corners {
    std::array<std::size_t, 8> entry;
    std::array<Big, 8> weight;

    Corners(const HashGridLevel& level, const std::array<float, 3>& point) {
        std::array<std::uint32_t, 3> cell;
        std::array<Big, 3> share;
        for (int a = 0; a < 3; ++a) {
            const Big x = Big(std::clamp(point[a], 0.0f, 1.0f)) * level.resolution;
            cell[a] = static_cast<std::uint32_t>(std::min(static_cast<int>(x), level.resolution - 1));
            share[a] = x - cell[a];
        }
        for (std::uint32_t c = 0; c < 8; ++c) {
            const std::uint32_t x = cell[0] + (c & 1), y = cell[1] + (c >> 1 & 1), z = cell[2] + (c >> 2);
            const auto side = static_cast<std::uint32_t>(level.resolution + 1);
            entry[c] = level.offset + (level.dense ? x + side * (y + side * z)
                                                   : (x ^ y * 2654435761u ^ z * 805459861u) % level.entries);
            weight[c] = (c & 1 ? share[0] : 1 - share[0]) * (c >> 1 & 1 ? share[1] : 1 - share[1]) *
                        (c >> 2 ? share[2] : 1 - share[2]);
        }
    }
};

struct Points {
    std::string input;
    std::vector<std::array<float, 3>> at;
};

std::vector<Points> hard_points() {
    Points inside{"inside", {}}, faces{"on the cube's faces and outside", {}}, borders{"on cells' borders", {}},
        tiny{"a hair from 0 and 1", {}}, same{"one point again and again", {}};
    const auto u = testing::random_values<float>(3 * 60, 4, 0, 1);
    for (int i = 0; i < 60; ++i) inside.at.push_back({u[3 * i], u[3 * i + 1], u[3 * i + 2]});
    for (const float x : {0.0f, 1.0f, -2.0f, 7.0f, 1e30f}) faces.at.push_back({x, 0.3f, 1 - std::min(x, 1.0f)});
    for (int i = 0; i < 24; ++i) borders.at.push_back({i / 24.0f, (24 - i) / 32.0f, 0.5f});
    for (const float x : {1e-40f, 1e-30f, 1e-7f, 1 - 1e-7f}) tiny.at.push_back({x, x, 1 - x});
    same.at.assign(40, {0.3f, 0.7f, 0.11f});
    return {inside, faces, borders, tiny, same};
}

struct Case {
    HashGrid grid;
    std::vector<float> table, positions;  // positions 3×n
    std::vector<float> feature_grad;      // rows of grid.rows()
    std::size_t n;
    std::vector<Big> features, features_unit, table_grad, table_unit;

    Case(const HashGrid& made, const Points& points) : grid(made), n(points.at.size()) {
        table = testing::random_values<float>(grid.entries * grid.features, 1);
        feature_grad = testing::random_values<float>(grid.rows() * n, 2);
        for (int a = 0; a < 3; ++a)
            for (const auto& point : points.at) positions.push_back(point[a]);
        features.resize(n * grid.rows());
        features_unit = features;
        table_grad.resize(table.size());
        table_unit = table_grad;
        for (std::size_t s = 0; s < n; ++s)
            for (std::size_t l = 0; l < grid.levels.size(); ++l) add(points.at[s], s, l);
    }

  private:
    // A position's rounding moves it by up to ε · resolution of a cell.
    void add(const std::array<float, 3>& point, std::size_t s, std::size_t l) {
        const Corners corners(grid.levels[l], point);
        for (int f = 0; f < grid.features; ++f) {
            const std::size_t row = l * grid.features + f, at = s * grid.rows() + row;
            const Big size = boost::multiprecision::abs(Big(feature_grad[at])) * (1 + grid.levels[l].resolution);
            for (int c = 0; c < 8; ++c) {
                const std::size_t entry = corners.entry[c] * grid.features + f;
                features[at] += corners.weight[c] * table[entry];
                table_grad[entry] += corners.weight[c] * feature_grad[at];
                table_unit[entry] += size;
            }
            features_unit[at] = 1 + grid.levels[l].resolution;  // |table| ≤ 1
        }
    }
};

void compare(const Case& c, const std::string& path, const std::string& input, const std::vector<float>& rows,
             const std::vector<float>& table_grad) {
    for (std::size_t i = 0; i < c.features.size(); ++i)
        ledger().add(quantity, "value", path, input, error_of(rows[i], c.features[i], c.features_unit[i]));
    // Entries nobody should touch have a unit of 0 and must be 0, but for the neighbour that rounding may choose.
    for (std::size_t i = 0; i < c.table_grad.size(); ++i) {
        const Big unit = c.table_unit[i] > 0 ? c.table_unit[i] : Big(1 + c.grid.levels.back().resolution);
        ledger().add(quantity, "gradient", path, input, error_of(table_grad[i], c.table_grad[i], unit));
    }
}

TEST(HashEncoding, ValueAndGradient) {
    for (const int features : {2, 4}) {
        const HashGrid grid = make_hash_grid(4, features, 10, 4, 512);
        for (const Points& points : hard_points()) {
            const Case c(grid, points);
            std::vector<float> columns(c.features.size()), rows(columns.size()), grad_columns(columns.size());
            std::vector<float> table_grad(c.table.size());
            const std::size_t width = grid.rows();
            hash_grid_forward<float>(grid, c.table, c.positions, columns);
            for (std::size_t s = 0; s < c.n; ++s) {
                for (std::size_t i = 0; i < width; ++i) {
                    rows[s * width + i] = columns[i * c.n + s];
                    grad_columns[i * c.n + s] = c.feature_grad[s * width + i];
                }
            }
            const HashGridChunk<float> chunk{c.positions, grad_columns};
            hash_grid_backward<float>(grid, {&chunk, 1}, table_grad, serial_for);
            compare(c, "reference", points.input, rows, table_grad);
            testing::on_every_target([&] {
                std::fill(table_grad.begin(), table_grad.end(), 0.0f);
                hash_grid_encode(grid, c.table, c.positions.data(), c.n, rows.data(), width);
                const HashGridRows part{c.positions.data(), c.feature_grad.data(), c.n, width,
                                        static_cast<std::size_t>(features)};
                for (std::size_t l = 0; l < grid.levels.size(); ++l)
                    hash_grid_add_gradient(grid, static_cast<int>(l), {&part, 1},
                                           table_grad.data() + grid.levels[l].offset * features);
                compare(c, "SIMD", points.input, rows, table_grad);
            });
        }
    }
}

}  // namespace
}  // namespace fieldgraft::stability
