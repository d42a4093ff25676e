#include "core/field/hash_network.h"

#include <algorithm>
#include <stdexcept>

#include "core/base/errors.h"
#include "core/base/shape.h"
#include "core/base/spans.h"
#include "core/field/kernel_field.h"
#include "core/kernels/field_mlp_simd.h"
#include "core/kernels/hash_grid_simd.h"
#include "core/kernels/spherical_harmonics_ref.h"

namespace fieldgraft {
namespace {

using NetworkPtr = std::shared_ptr<const HashNetwork>;

using torch::autograd::AutogradContext;
using torch::autograd::Variable;
using torch::autograd::variable_list;

// Long chunks reuse a level's table while it is in the cache, short ones keep every thread busy.
struct Chunks {
    std::int64_t samples, size;

    explicit Chunks(std::int64_t n) : samples(n), size(std::clamp<std::int64_t>((n / 8 + 15) / 16 * 16, 512, 8192)) {}
    std::int64_t count() const { return (samples + size - 1) / size; }
    std::int64_t first(std::int64_t chunk) const { return chunk * size; }
    std::int64_t length(std::int64_t chunk) const { return std::min(size, samples - chunk * size); }

    // Calls body(chunk) for every chunk, side by side, without recording gradients.
    void for_each(const std::function<void(std::int64_t)>& body) const {
        at::parallel_for(0, count(), 1, [&](std::int64_t begin, std::int64_t end) {
            at::NoGradGuard no_grad;  // the mode is a thread's own
            for (std::int64_t c = begin; c < end; ++c) body(c);
        });
    }
};

float* row_of(const Tensor& rows, std::int64_t first) {
    return rows.defined() ? rows.mutable_data_ptr<float>() + first * rows.size(1) : nullptr;
}

// N×width as the kernels read it: rows padded with zeros.
Tensor padded_rows(const Tensor& rows) {
    const std::int64_t width = rows.size(1), whole = padded(static_cast<int>(width));
    if (width == whole) return rows.contiguous();
    Tensor out = at::zeros({rows.size(0), whole}, rows.options());
    out.narrow(1, 0, width).copy_(rows);
    return out;
}

// What one function of the two networks uses: the matrices it does not have are zeros.
FieldMlpWeights packed_weights(const FieldMlpShape& shape, const std::vector<Tensor>& matrices, bool density) {
    const auto shapes = shape.matrices();
    std::vector<Tensor> all;
    for (std::size_t i = 0; i < shapes.size(); ++i) {
        const bool own = density == (i < 2);
        all.push_back(own ? matrices[density ? i : i - 2].contiguous() : at::zeros(shapes[i], at::kFloat));
    }
    FieldMlpMatrices spans;
    for (const Tensor& matrix : all) spans.push_back(values(matrix));
    FieldMlpWeights weights(shape);
    weights.pack(spans);
    return weights;
}

// The gradients of the matrices [first, first + count) of the five, out of the chunks' sums.
std::vector<Tensor> matrix_gradients(const FieldMlpShape& shape, const std::vector<FieldMlpGradients>& parts,
                                     const std::vector<Tensor>& like, std::size_t first) {
    FieldMlpGradients total(shape);
    for (const FieldMlpGradients& part : parts) total.add(part);
    std::vector<Tensor> all, wanted;
    std::vector<std::span<float>> spans;
    for (const auto& size : shape.matrices()) {
        all.push_back(at::zeros(size, at::kFloat));
        spans.push_back(mutable_values(all.back()));
    }
    total.add_to(shape, spans);
    for (std::size_t i = 0; i < like.size(); ++i) wanted.push_back(all[first + i]);
    return wanted;
}

// Unit-cube coordinates (3×n) of a chunk; `inside` (n) is 1 within the box, 0 outside.
void to_unit_cube(const HashNetwork& network, const float* positions, std::int64_t n, float* unit, float* inside) {
    const float scale = static_cast<float>(1.0 / longest_edge(network.box_min, network.box_max));
    std::fill(inside, inside + n, 1.0f);
    for (int c = 0; c < 3; ++c) {
        const float low = static_cast<float>(network.box_min[c]), high = static_cast<float>(network.box_max[c]);
        for (std::int64_t i = 0; i < n; ++i) {
            const float x = positions[3 * i + c];
            unit[c * n + i] = (x - low) * scale;
            inside[i] = x >= low && x <= high ? inside[i] : 0.0f;
        }
    }
}

// A tensor that keeps the network alive as long as the graph that needs it.
Tensor holder_of(const NetworkPtr& network) {
    return at::from_blob(
        const_cast<HashNetwork*>(network.get()), {1}, [network](void*) {}, at::kByte);
}

FieldMlpShape density_shape(const HashNetwork& network, const Tensor& w0, const Tensor& w1) {
    return {static_cast<int>(network.grid.rows()), static_cast<int>(w0.size(0)), static_cast<int>(w1.size(0)), 1, 1};
}

class DensityFunction : public torch::autograd::Function<DensityFunction> {
  public:
    static variable_list forward(AutogradContext* context, const NetworkPtr& network, const Variable& positions,
                                 const Variable& table, const Variable& w0, const Variable& w1) {
        const Chunks chunks(positions.size(0));
        const std::int64_t n = chunks.samples;
        const FieldMlpShape shape = density_shape(*network, w0, w1);
        const FieldMlpWeights weights = packed_weights(shape, {w0, w1}, true);
        const std::int64_t row = padded(shape.encoded), width = padded(shape.features);
        const bool keep = context != nullptr;
        const Tensor features = at::empty({n, width}, positions.options());
        const Tensor density = at::empty({n}, positions.options());
        const Tensor kept = keep ? at::empty({n, row}, positions.options()) : Tensor();
        std::vector<Tensor> units(keep ? chunks.count() : 0);
        chunks.for_each([&](std::int64_t c) {
            const std::int64_t first = chunks.first(c), count = chunks.length(c);
            const Tensor unit = at::empty({3, count}, positions.options());
            const Tensor encoded = keep ? kept.narrow(0, first, count) : at::empty({count, row}, positions.options());
            float* part = density.mutable_data_ptr<float>() + first;  // 1 inside the box, 0 outside, to begin with
            to_unit_cube(*network, positions.const_data_ptr<float>() + 3 * first, count, unit.mutable_data_ptr<float>(),
                         part);
            hash_grid_encode(network->grid, values(table), unit.const_data_ptr<float>(), count,
                             encoded.mutable_data_ptr<float>(), row);
            density_mlp_forward(weights, encoded.const_data_ptr<float>(), static_cast<int>(count),
                                row_of(features, first));
            Tensor log_density = features.narrow(0, first, count).select(1, 0) + log_density_offset;
            density.narrow(0, first, count).mul_(log_density.clamp_max_(log_density_limit).exp_());
            if (keep) units[c] = unit;
        });
        if (keep) {
            context->save_for_backward({table, w0, w1, density, kept});
            context->saved_data["units"] = units;
            context->saved_data["network"] = holder_of(network);
        }
        return {density, features.narrow(1, 0, shape.features)};
    }

    static variable_list backward(AutogradContext* context, variable_list grads) {
        at::NoGradGuard no_grad;
        const Tensor holder = context->saved_data["network"].toTensor();
        const auto* network = static_cast<const HashNetwork*>(holder.const_data_ptr());
        const variable_list tensors = context->get_saved_variables();
        const Tensor &table = tensors[0], &w0 = tensors[1], &w1 = tensors[2], &density = tensors[3],
                     &encoded = tensors[4];
        const std::vector<Tensor> units = context->saved_data["units"].toTensorVector();
        const Chunks chunks(density.size(0));
        const FieldMlpShape shape = density_shape(*network, w0, w1);
        const FieldMlpWeights weights = packed_weights(shape, {w0, w1}, true);
        Tensor features_grad = at::zeros({chunks.samples, padded(shape.features)}, density.options());
        if (grads[1].defined()) features_grad.narrow(1, 0, shape.features).copy_(grads[1]);
        // Where the box ends density is a constant 0, and density · gradient is 0 too.
        if (grads[0].defined()) features_grad.select(1, 0).addcmul_(grads[0], density);
        const Tensor encoded_grad = at::empty_like(encoded);
        std::vector<FieldMlpGradients> sums(chunks.count(), FieldMlpGradients(shape));
        std::vector<HashGridRows> rows(chunks.count());
        chunks.for_each([&](std::int64_t c) {
            const std::int64_t first = chunks.first(c), count = chunks.length(c);
            density_mlp_backward(weights, row_of(encoded, first), row_of(features_grad, first), static_cast<int>(count),
                                 sums[c], row_of(encoded_grad, first));
            rows[c] = {units[c].const_data_ptr<float>(), row_of(encoded_grad, first), static_cast<std::size_t>(count),
                       static_cast<std::size_t>(encoded.size(1)), static_cast<std::size_t>(network->grid.features)};
        });
        const Tensor table_grad = at::zeros_like(table);
        add_table_gradient(network->grid, rows, table_grad);
        std::vector<Tensor> matrices = matrix_gradients(shape, sums, {w0, w1}, 0);
        return {Variable(), Variable(), table_grad, matrices[0], matrices[1]};
    }

  private:
    static void add_table_gradient(const HashGrid& grid, const std::vector<HashGridRows>& rows, const Tensor& grad) {
        // Fine levels cost more than coarse ones: dealt out so that two contiguous halves are alike.
        const std::int64_t count = static_cast<std::int64_t>(grid.levels.size());
        std::vector<int> order;
        for (int l = 0; l < count; l += 2) order.push_back(l);
        for (int l = 1; l < count; l += 2) order.push_back(l);
        float* first = grad.mutable_data_ptr<float>();
        at::parallel_for(0, count, 1, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t i = begin; i < end; ++i) {
                const auto& level = grid.levels[order[i]];
                hash_grid_add_gradient(grid, order[i], rows, first + level.offset * grid.features);
            }
        });
    }
};

// The directions of a chunk, samples of a ray taken together: which one each sample has, and their basis' values.
struct ChunkRays {
    Tensor ray;    // n int32
    Tensor basis;  // R×B, padded
};

ChunkRays rays_of_chunk(const Tensor& directions, std::int64_t first, std::int64_t count, int degree) {
    const float* d = directions.const_data_ptr<float>() + 3 * first;
    const Tensor ray = at::empty({count}, at::kInt);
    std::int32_t* number = ray.mutable_data_ptr<std::int32_t>();
    std::vector<std::int64_t> starts;
    for (std::int64_t i = 0; i < count; ++i) {
        if (i == 0 || !std::equal(d + 3 * i, d + 3 * i + 3, d + 3 * i - 3)) starts.push_back(i);
        number[i] = static_cast<std::int32_t>(starts.size()) - 1;
    }
    const std::int64_t rays = static_cast<std::int64_t>(starts.size()), terms = std::int64_t{degree} * degree;
    std::vector<float> columns(3 * rays), terms_of(terms * rays);
    for (std::int64_t r = 0; r < rays; ++r) {
        for (int c = 0; c < 3; ++c) columns[c * rays + r] = d[3 * starts[r] + c];
    }
    spherical_harmonics<float>(degree, columns, terms_of);
    const Tensor basis = at::zeros({rays, padded(static_cast<int>(terms))}, at::kFloat);
    basis.narrow(1, 0, terms).copy_(at::from_blob(terms_of.data(), {terms, rays}, at::kFloat).t());
    return {ray, basis};
}

FieldMlpShape color_shape(std::int64_t features, std::int64_t degree, const Tensor& w0) {
    return {1, 1, static_cast<int>(features), static_cast<int>(degree * degree), static_cast<int>(w0.size(0))};
}

class ColorFunction : public torch::autograd::Function<ColorFunction> {
  public:
    static variable_list forward(AutogradContext* context, std::int64_t sh_degree, const Variable& features,
                                 const Variable& directions, const Variable& w0, const Variable& w1,
                                 const Variable& w2) {
        const Chunks chunks(features.size(0));
        const FieldMlpShape shape = color_shape(features.size(1), sh_degree, w0);
        const FieldMlpWeights weights = packed_weights(shape, {w0, w1, w2}, false);
        const std::int64_t width = padded(shape.color_hidden);
        const bool keep = context != nullptr;
        const Tensor inputs = padded_rows(features), packed_directions = directions.contiguous();
        const Tensor color = at::empty({chunks.samples, 3}, features.options());
        const Tensor kept = keep ? at::empty({2, chunks.samples, width}, features.options()) : Tensor();
        std::vector<Tensor> rays(keep ? 2 * chunks.count() : 0);
        chunks.for_each([&](std::int64_t c) {
            const std::int64_t first = chunks.first(c), count = chunks.length(c);
            const ChunkRays own = rays_of_chunk(packed_directions, first, count, static_cast<int>(sh_degree));
            const Tensor base = at::empty({own.basis.size(0), width}, features.options());
            ray_color_base(weights, own.basis.const_data_ptr<float>(), static_cast<int>(own.basis.size(0)),
                           base.mutable_data_ptr<float>());
            const Tensor scratch = keep ? Tensor() : at::empty({2, count, width}, features.options());
            float* hidden0 = keep ? row_of(kept[0], first) : row_of(scratch[0], 0);
            float* hidden1 = keep ? row_of(kept[1], first) : row_of(scratch[1], 0);
            color_mlp_forward(weights, row_of(inputs, first), own.ray.const_data_ptr<std::int32_t>(),
                              base.const_data_ptr<float>(), static_cast<int>(count), hidden0, hidden1,
                              row_of(color, first));
            if (!keep) return;
            rays[2 * c] = own.ray;
            rays[2 * c + 1] = own.basis;
        });
        if (keep) {
            context->save_for_backward({w0, w1, w2, inputs, kept, color});
            context->saved_data["rays"] = rays;
            context->saved_data["features"] = features.size(1);
            context->saved_data["degree"] = sh_degree;
        }
        return {color};
    }

    static variable_list backward(AutogradContext* context, variable_list grads) {
        at::NoGradGuard no_grad;
        const variable_list tensors = context->get_saved_variables();
        const Tensor &w0 = tensors[0], &w1 = tensors[1], &w2 = tensors[2], &inputs = tensors[3], &kept = tensors[4],
                     &color = tensors[5];
        const std::vector<Tensor> rays = context->saved_data["rays"].toTensorVector();
        const std::int64_t feature_size = context->saved_data["features"].toInt();
        const Chunks chunks(color.size(0));
        const FieldMlpShape shape = color_shape(feature_size, context->saved_data["degree"].toInt(), w0);
        const FieldMlpWeights weights = packed_weights(shape, {w0, w1, w2}, false);
        const Tensor color_grad = grads[0].contiguous(), features_grad = at::empty_like(inputs);
        std::vector<FieldMlpGradients> sums(chunks.count(), FieldMlpGradients(shape));
        chunks.for_each([&](std::int64_t c) {
            const std::int64_t first = chunks.first(c);
            const Tensor &ray = rays[2 * c], &basis = rays[2 * c + 1];
            const Tensor base_grad = at::zeros({basis.size(0), padded(shape.color_hidden)}, color.options());
            color_mlp_backward(weights, row_of(inputs, first), ray.const_data_ptr<std::int32_t>(),
                               row_of(kept[0], first), row_of(kept[1], first), row_of(color, first),
                               row_of(color_grad, first), static_cast<int>(chunks.length(c)), sums[c],
                               base_grad.mutable_data_ptr<float>(), row_of(features_grad, first));
            ray_color_base_backward(weights, basis.const_data_ptr<float>(), base_grad.const_data_ptr<float>(),
                                    static_cast<int>(basis.size(0)), sums[c]);
        });
        std::vector<Tensor> matrices = matrix_gradients(shape, sums, {w0, w1, w2}, 2);
        return {Variable(), features_grad.narrow(1, 0, feature_size), Variable(), matrices[0], matrices[1],
                matrices[2]};
    }
};

bool records_gradients(std::initializer_list<const Tensor*> inputs) {
    if (!at::GradMode::is_enabled()) return false;
    return std::any_of(inputs.begin(), inputs.end(), [](const Tensor* t) { return t->requires_grad(); });
}

void check_points(const char* what, const Tensor& points, std::int64_t columns) {
    if (points.dim() == 2 && points.size(1) == columns && points.scalar_type() == at::kFloat && points.is_cpu()) return;
    throw std::invalid_argument(fmt::format("{} must be float32 Nx{} on the CPU, not {} {}", what, columns,
                                            at::toString(points.scalar_type()), shape_text(points)));
}

}  // namespace

DensityFeatures hash_density(const std::shared_ptr<const HashNetwork>& network, const Tensor& positions,
                             const Tensor& table, const std::vector<Tensor>& weights) {
    check_points("positions", positions, 3);
    const Tensor packed = positions.contiguous();
    const bool record = records_gradients({&table, &weights[0], &weights[1]});
    const variable_list out = record
                                  ? DensityFunction::apply(network, packed, table, weights[0], weights[1])
                                  : DensityFunction::forward(nullptr, network, packed, table, weights[0], weights[1]);
    return {out[0], out[1]};
}

Tensor hash_color(int sh_degree, const Tensor& features, const Tensor& directions, const std::vector<Tensor>& weights) {
    const std::int64_t degree = sh_degree;
    check_points("features", features, weights[0].size(1) - degree * degree);
    check_points("directions", directions, 3);
    if (features.size(0) != directions.size(0)) {
        throw std::invalid_argument(fmt::format("{} features but {} directions", features.size(0), directions.size(0)));
    }
    const bool record = records_gradients({&features, &weights[0], &weights[1], &weights[2]});
    return record
               ? ColorFunction::apply(degree, features, directions, weights[0], weights[1], weights[2])[0]
               : ColorFunction::forward(nullptr, degree, features, directions, weights[0], weights[1], weights[2])[0];
}

}  // namespace fieldgraft
