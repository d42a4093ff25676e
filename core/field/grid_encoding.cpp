#include "core/field/grid_encoding.h"

#include <algorithm>

#include "core/base/errors.h"
#include "core/base/shape.h"
#include "core/base/spans.h"
#include "core/field/torch_parallel.h"

namespace fieldgraft {
namespace {

using torch::autograd::AutogradContext;
using torch::autograd::variable_list;
using GridPtr = std::shared_ptr<const HashGrid>;

constexpr std::int64_t chunk_points = 4096;

std::int64_t point_chunks(std::int64_t points) {
    return (points + chunk_points - 1) / chunk_points;
}

// Columns [first, first + n) of a rows×N tensor, one after the other row: rows×n contiguous.
void copy_columns(const float* from, std::int64_t from_stride, float* to, std::int64_t to_stride, std::int64_t rows,
                  std::int64_t n) {
    for (std::int64_t row = 0; row < rows; ++row) std::copy_n(from + row * from_stride, n, to + row * to_stride);
}

// Points N×3 → unit cube, chunk after chunk, each 3×n.
std::vector<Tensor> unit_chunks(const Tensor& positions, const FieldGeometry& geometry) {
    const float scale = static_cast<float>(1 / longest_edge(geometry));
    const std::int64_t points = positions.size(0);
    const float* p = positions.const_data_ptr<float>();
    std::vector<Tensor> chunks(point_chunks(points));
    for (std::size_t i = 0; i < chunks.size(); ++i) {
        const std::int64_t first = static_cast<std::int64_t>(i) * chunk_points,
                           n = std::min(chunk_points, points - first);
        chunks[i] = at::empty({3, n}, at::kFloat);
        float* unit = chunks[i].mutable_data_ptr<float>();
        for (int c = 0; c < 3; ++c) {
            const float low = static_cast<float>(geometry.box_min[c]);
            for (std::int64_t k = 0; k < n; ++k) unit[c * n + k] = (p[3 * (first + k) + c] - low) * scale;
        }
    }
    return chunks;
}

struct EncodeFunction : torch::autograd::Function<EncodeFunction> {
    static Tensor forward(AutogradContext* ctx, const Tensor& table, const std::vector<Tensor>& chunks,
                          std::int64_t points, const GridPtr& grid) {
        const std::int64_t rows = static_cast<std::int64_t>(grid->rows());
        Tensor encoded = at::empty({rows, points}, table.options());
        float* out = encoded.mutable_data_ptr<float>();
        torch_parallel_for(point_chunks(points), 1, [&](std::int64_t begin, std::int64_t end) {
            std::vector<float> part;
            for (std::int64_t i = begin; i < end; ++i) {
                const std::int64_t n = chunks[i].size(1);
                part.resize(static_cast<std::size_t>(rows * n));
                hash_grid_forward<float>(*grid, values(table), values(chunks[i]), part);
                copy_columns(part.data(), n, out + i * chunk_points, points, rows, n);
            }
        });
        ctx->saved_data["chunks"] = chunks;
        ctx->saved_data["entries"] = table.size(0);
        ctx->saved_data["grid"] = at::from_blob(
            const_cast<HashGrid*>(grid.get()), {1}, [grid](void*) {}, at::kByte);
        return encoded;
    }

    static variable_list backward(AutogradContext* ctx, const variable_list& grads) {
        const auto* grid = static_cast<const HashGrid*>(ctx->saved_data["grid"].toTensor().const_data_ptr());
        const std::vector<Tensor> chunks = ctx->saved_data["chunks"].toTensorVector();
        const Tensor grad = grads[0].contiguous();
        const std::int64_t rows = grad.size(0), points = grad.size(1);
        std::vector<std::vector<float>> parts(chunks.size());
        std::vector<HashGridChunk<float>> kernel_chunks(chunks.size());
        torch_parallel_for(static_cast<std::int64_t>(chunks.size()), 1, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t i = begin; i < end; ++i) {
                const std::int64_t n = chunks[i].size(1);
                parts[i].resize(static_cast<std::size_t>(rows * n));
                copy_columns(grad.const_data_ptr<float>() + i * chunk_points, points, parts[i].data(), n, rows, n);
                kernel_chunks[i] = {values(chunks[i]), parts[i]};
            }
        });
        Tensor table_grad = at::zeros({ctx->saved_data["entries"].toInt(), grid->features}, grad.options());
        hash_grid_backward<float>(*grid, kernel_chunks, mutable_values(table_grad), torch_parallel_for);
        return {table_grad, Tensor(), Tensor(), Tensor()};
    }
};

}  // namespace

HashGrid make_level_grid(const std::vector<int>& resolutions, int features, int log2_table_size) {
    if (resolutions.empty() || features < 1 || features > 8 || log2_table_size < 1 || log2_table_size > 28) {
        throw std::invalid_argument(
            fmt::format("a grid needs levels, 1–8 features and a table of 2^1–2^28, not {}, {}, 2^{}",
                        resolutions.size(), features, log2_table_size));
    }
    HashGrid grid;
    grid.features = features;
    for (const int resolution : resolutions) {
        if (resolution < 1 || resolution > 4096) {
            throw std::invalid_argument(fmt::format("a level's resolution must be 1 to 4096, not {}", resolution));
        }
        const std::uint64_t side = static_cast<std::uint64_t>(resolution) + 1, vertices = side * side * side;
        const std::uint64_t table = std::uint64_t{1} << log2_table_size;
        const bool dense = vertices <= table;
        grid.levels.push_back({resolution, static_cast<std::uint32_t>(dense ? vertices : table), grid.entries, dense});
        grid.entries += grid.levels.back().entries;
    }
    return grid;
}

Tensor encode_positions(const GridPtr& grid, const FieldGeometry& geometry, const Tensor& positions,
                        const Tensor& table) {
    const Tensor points = positions.detach().contiguous();
    return EncodeFunction::apply(table.contiguous(), unit_chunks(points, geometry), points.size(0), grid);
}

}  // namespace fieldgraft
