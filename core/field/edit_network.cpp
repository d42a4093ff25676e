#include "core/field/edit_network.h"

#include <algorithm>

#include "core/base/errors.h"
#include "core/base/spans.h"
#include "core/field/torch_parallel.h"
#include "core/kernels/edit_mlp_simd.h"
#include "core/kernels/hash_grid_simd.h"

namespace fieldgraft {
namespace {

using torch::autograd::AutogradContext;
using torch::autograd::Variable;
using torch::autograd::variable_list;
using NetworkPtr = std::shared_ptr<const EditNetwork>;

constexpr std::int64_t chunk_samples = 4096;
constexpr std::int64_t table_parts = 4;  // of the samples, whose gradients to the table are summed side by side

std::int64_t chunks_of(std::int64_t samples) {
    return (samples + chunk_samples - 1) / chunk_samples;
}

std::int64_t length_of(std::int64_t chunk, std::int64_t samples) {
    return std::min(chunk_samples, samples - chunk * chunk_samples);
}

EditMlpWeights packed(const EditNetwork& network, const variable_list& matrices) {
    return {network.mlp, {values(matrices[0]), values(matrices[1]), values(matrices[2]), values(matrices[3])}};
}

// The columns of the heads' tensors (undefined ones have none).
template <class T>
EditColumns<T> columns_of(const EditNetwork& network, const variable_list& heads, const Tensor& index) {
    EditColumns<T> columns;
    columns.index = index.const_data_ptr<std::int64_t>();
    std::size_t k = 0;
    for (std::size_t h = 0; h < heads.size(); ++h) {
        for (int i = 0; i < network.heads[h]; ++i, ++k) {
            columns.data[k] = heads[h].defined() ? heads[h].data_ptr<float>() + i : nullptr;
            columns.step[k] = static_cast<std::size_t>(network.heads[h]);
        }
    }
    return columns;
}

// `count` asked positions in the unit cube, 3×count.
void to_unit_cube(const FieldGeometry& geometry, const float* positions, const std::int64_t* index, std::int64_t count,
                  float* unit) {
    const float scale = static_cast<float>(1 / longest_edge(geometry));
    for (int c = 0; c < 3; ++c) {
        const float low = static_cast<float>(geometry.box_min[c]);
        for (std::int64_t i = 0; i < count; ++i) unit[c * count + i] = (positions[3 * index[i] + c] - low) * scale;
    }
}

struct EditFunction : torch::autograd::Function<EditFunction> {
    // matrices: hidden weight and bias, output weight and bias.
    static variable_list forward(AutogradContext* context, const NetworkPtr& network, const Tensor& positions,
                                 const Tensor& index, const Tensor& table, const Tensor& w0, const Tensor& b0,
                                 const Tensor& w1, const Tensor& b1) {
        const std::int64_t all = positions.size(0), asked = index.size(0);
        const EditMlpWeights weights = packed(*network, {w0, b0, w1, b1});
        const std::size_t row = static_cast<std::size_t>(weights.row());
        const bool keep = context != nullptr;
        const Tensor encoded = keep ? at::empty({asked, weights.row()}, table.options()) : Tensor();
        const Tensor units = keep ? at::empty({3 * asked}, table.options()) : Tensor();
        variable_list heads;
        for (const int size : network->heads) {
            const std::vector<std::int64_t> shape =
                size == 1 ? std::vector<std::int64_t>{all} : std::vector<std::int64_t>{all, size};
            heads.push_back(asked == all ? at::empty(shape, table.options()) : at::zeros(shape, table.options()));
        }
        const EditColumns<float> columns = columns_of<float>(*network, heads, index);
        const float* from = positions.const_data_ptr<float>();
        torch_parallel_for(chunks_of(asked), 1, [&](std::int64_t begin, std::int64_t end) {
            std::vector<float> own_unit(keep ? 0 : 3 * chunk_samples), own_rows(keep ? 0 : row * chunk_samples);
            for (std::int64_t c = begin; c < end; ++c) {
                const std::int64_t first = c * chunk_samples, n = length_of(c, asked);
                float* unit = keep ? units.mutable_data_ptr<float>() + 3 * first : own_unit.data();
                float* rows = keep ? encoded.mutable_data_ptr<float>() + row * first : own_rows.data();
                to_unit_cube(network->geometry, from, columns.index + first, n, unit);
                hash_grid_encode(network->grid, values(table), unit, n, rows, row);
                for (std::int64_t s = 0; s < n; ++s) rows[s * row + network->grid.rows()] = 1;  // the bias' input
                EditColumns<float> own = columns;
                own.index += first;
                edit_mlp_forward(weights, rows, static_cast<int>(n), own);
            }
        });
        if (keep) {
            context->save_for_backward({index, table, w0, b0, w1, b1, encoded, units});
            context->set_materialize_grads(false);
            context->saved_data["network"] = at::from_blob(
                const_cast<EditNetwork*>(network.get()), {1}, [network](void*) {}, at::kByte);
        }
        return heads;
    }

    static variable_list backward(AutogradContext* context, variable_list grads) {
        at::NoGradGuard no_grad;
        const Tensor holder = context->saved_data["network"].toTensor();
        const auto* network = static_cast<const EditNetwork*>(holder.const_data_ptr());
        const variable_list saved = context->get_saved_variables();
        const Tensor &index = saved[0], &table = saved[1], &encoded = saved[6], &units = saved[7];
        const EditMlpWeights weights = packed(*network, {saved[2], saved[3], saved[4], saved[5]});
        for (Tensor& grad : grads) {
            if (grad.defined()) grad = grad.contiguous();
        }
        const EditColumns<const float> columns = columns_of<const float>(*network, grads, index);
        const std::int64_t asked = index.size(0), chunks = chunks_of(asked), row = weights.row();
        const Tensor encoded_grad = at::empty_like(encoded);
        std::vector<EditMlpGradients> sums(chunks, EditMlpGradients(weights));
        std::vector<HashGridRows> rows(chunks);
        torch_parallel_for(chunks, 1, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t c = begin; c < end; ++c) {
                const std::int64_t first = c * chunk_samples, n = length_of(c, asked);
                float* out = encoded_grad.mutable_data_ptr<float>() + first * row;
                EditColumns<const float> own = columns;
                own.index += first;
                edit_mlp_backward(weights, encoded.const_data_ptr<float>() + first * row, static_cast<int>(n), own,
                                  sums[c], out);
                rows[c] = {units.const_data_ptr<float>() + 3 * first, out, static_cast<std::size_t>(n),
                           static_cast<std::size_t>(row), static_cast<std::size_t>(network->grid.features)};
            }
        });
        variable_list matrices;
        for (int i = 2; i < 6; ++i) matrices.push_back(at::zeros_like(saved[i]));
        EditMlpGradients total(weights);
        for (const EditMlpGradients& part : sums) total.add(part);
        total.add_to(network->mlp, {mutable_values(matrices[0]), mutable_values(matrices[1]),
                                    mutable_values(matrices[2]), mutable_values(matrices[3])});
        return {Variable(),  Variable(),  Variable(),  table_gradient(network->grid, rows, table),
                matrices[0], matrices[1], matrices[2], matrices[3]};
    }

    static Tensor table_gradient(const HashGrid& grid, const std::vector<HashGridRows>& rows, const Tensor& table) {
        const std::int64_t levels = static_cast<std::int64_t>(grid.levels.size()),
                           chunks = static_cast<std::int64_t>(rows.size());
        const Tensor parts = at::zeros({table_parts, table.size(0), table.size(1)}, table.options());
        share_out(table_parts * levels, [&](std::int64_t task) {
            const std::int64_t part = task % table_parts;
            const int level = static_cast<int>(levels - 1 - task / table_parts);  // fine ones, which cost most, first
            const std::int64_t first = part * chunks / table_parts, last = (part + 1) * chunks / table_parts;
            hash_grid_add_gradient(grid, level, std::span(rows).subspan(first, last - first),
                                   parts[part].mutable_data_ptr<float>() + grid.levels[level].offset * grid.features);
        });
        return parts.sum(0);
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

std::vector<Tensor> edit_network(const NetworkPtr& network, const Tensor& positions, const Tensor& index,
                                 const Tensor& table, const Tensor& hidden_weight, const Tensor& hidden_bias,
                                 const Tensor& output_weight, const Tensor& output_bias) {
    const variable_list in{positions.detach().contiguous(), index.contiguous(),       table.contiguous(),
                           hidden_weight.contiguous(),      hidden_bias.contiguous(), output_weight.contiguous(),
                           output_bias.contiguous()};
    const bool record = at::GradMode::is_enabled() &&
                        std::any_of(in.begin() + 2, in.end(), [](const Tensor& t) { return t.requires_grad(); });
    return record ? EditFunction::apply(network, in[0], in[1], in[2], in[3], in[4], in[5], in[6])
                  : EditFunction::forward(nullptr, network, in[0], in[1], in[2], in[3], in[4], in[5], in[6]);
}

}  // namespace fieldgraft
