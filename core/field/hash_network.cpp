#include "core/field/hash_network.h"

#include <stdexcept>

#include "core/base/errors.h"
#include "core/base/shape.h"
#include "core/base/spans.h"
#include "core/field/torch_parallel.h"
#include "core/kernels/spherical_harmonics_ref.h"

namespace fieldgraft {
namespace {

constexpr std::int64_t chunk_size = 2048;  // samples; the widest activations are then 512 KiB

using NetworkPtr = std::shared_ptr<const HashNetwork>;

using torch::autograd::AutogradContext;
using torch::autograd::Variable;
using torch::autograd::variable_list;

std::int64_t chunk_count(std::int64_t samples) {
    return (samples + chunk_size - 1) / chunk_size;
}

// Calls body(chunk, first sample, number of samples) for every chunk, chunks side by side, without recording gradients.
void for_each_chunk(std::int64_t samples, const std::function<void(std::int64_t, std::int64_t, std::int64_t)>& body) {
    at::parallel_for(0, chunk_count(samples), 1, [&](std::int64_t begin, std::int64_t end) {
        at::NoGradGuard no_grad;  // the mode is a thread's own
        for (std::int64_t c = begin; c < end; ++c) {
            body(c, c * chunk_size, std::min(chunk_size, samples - c * chunk_size));
        }
    });
}

// What the backward pass needs of every chunk, feature-major (rows × samples of the chunk).
using Saved = std::vector<Tensor>;

Tensor sum_in_order(const std::vector<Tensor>& parts, const Tensor& like) {
    Tensor total = at::zeros_like(like);
    for (const Tensor& part : parts) total.add_(part);
    return total;
}

// Unit-cube coordinates (3×n) of a chunk; `inside` (n) is 1 within the box, 0 outside.
void to_unit_cube(const HashNetwork& network, const float* positions, std::int64_t n, float* unit, float* inside) {
    double edge = 0;
    for (int c = 0; c < 3; ++c) edge = std::max(edge, network.box_max[c] - network.box_min[c]);
    const float scale = static_cast<float>(1.0 / edge);
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

struct DensityChunk {
    Tensor unit, inside, encoded, hidden;
};

// The forward pass of one chunk; writes its columns of features (F×N) and its part of density (N).
DensityChunk density_chunk(const HashNetwork& network, const Tensor& positions, const Tensor& table,
                           const std::vector<Tensor>& weights, std::int64_t first, std::int64_t n, Tensor& features,
                           Tensor& density) {
    DensityChunk chunk;
    const auto options = positions.options();
    chunk.unit = at::empty({3, n}, options);
    chunk.inside = at::empty({n}, options);
    to_unit_cube(network, positions.const_data_ptr<float>() + 3 * first, n, chunk.unit.mutable_data_ptr<float>(),
                 chunk.inside.mutable_data_ptr<float>());
    chunk.encoded = at::empty({static_cast<std::int64_t>(network.grid.rows()), n}, options);
    hash_grid_forward<float>(network.grid, values(table), values(chunk.unit), mutable_values(chunk.encoded));
    chunk.hidden = at::mm(weights[0], chunk.encoded).relu_();
    Tensor out = features.narrow(1, first, n);
    at::mm_out(out, weights[1], chunk.hidden);
    Tensor part = density.narrow(0, first, n);
    at::add_out(part, out.select(0, 0), at::scalar_tensor(log_density_offset, options));
    part.clamp_max_(log_density_limit).exp_().mul_(chunk.inside);
    return chunk;
}

// A tensor that keeps the network alive as long as the graph that needs it.
Tensor holder_of(const NetworkPtr& network) {
    return at::from_blob(
        const_cast<HashNetwork*>(network.get()), {1}, [network](void*) {}, at::kByte);
}

class DensityFunction : public torch::autograd::Function<DensityFunction> {
  public:
    static variable_list forward(AutogradContext* context, const NetworkPtr& network, const Variable& positions,
                                 const Variable& table, const Variable& w0, const Variable& w1) {
        const std::int64_t n = positions.size(0);
        Tensor features = at::empty({w1.size(0), n}, positions.options());
        Tensor density = at::empty({n}, positions.options());
        const bool keep = context != nullptr;
        Saved saved(keep ? 4 * chunk_count(n) : 0);
        for_each_chunk(n, [&](std::int64_t c, std::int64_t first, std::int64_t count) {
            DensityChunk chunk = density_chunk(*network, positions, table, {w0, w1}, first, count, features, density);
            if (!keep) return;
            saved[4 * c] = chunk.unit;
            saved[4 * c + 1] = chunk.inside;
            saved[4 * c + 2] = chunk.encoded;
            saved[4 * c + 3] = chunk.hidden;
        });
        if (keep) {
            context->save_for_backward({table, w0, w1, density});
            context->saved_data["chunks"] = saved;
            context->saved_data["network"] = holder_of(network);
        }
        return {density, features.t()};
    }

    static variable_list backward(AutogradContext* context, variable_list grads) {
        at::NoGradGuard no_grad;
        const Tensor holder = context->saved_data["network"].toTensor();
        const auto* network = static_cast<const HashNetwork*>(holder.const_data_ptr());
        const variable_list tensors = context->get_saved_variables();
        const Tensor &table = tensors[0], &w0 = tensors[1], &w1 = tensors[2], &density = tensors[3];
        const Saved saved = context->saved_data["chunks"].toTensorVector();
        const std::int64_t n = density.size(0);
        std::vector<Tensor> grads0(chunk_count(n)), grads1(chunk_count(n)), encoded_grads(chunk_count(n));
        for_each_chunk(n, [&](std::int64_t c, std::int64_t first, std::int64_t count) {
            const Tensor &encoded = saved[4 * c + 2], &hidden = saved[4 * c + 3];
            Tensor out_grad = at::zeros({w1.size(0), count}, density.options());
            if (grads[1].defined()) out_grad.copy_(grads[1].narrow(0, first, count).t());
            if (grads[0].defined()) {
                // Where the box ends density is a constant 0, and density · gradient is 0 too.
                out_grad.select(0, 0).addcmul_(grads[0].narrow(0, first, count), density.narrow(0, first, count));
            }
            grads1[c] = at::mm(out_grad, hidden.t());
            Tensor hidden_grad = at::mm(w1.t(), out_grad);
            at::threshold_backward_out(hidden_grad, hidden_grad, hidden, 0);
            grads0[c] = at::mm(hidden_grad, encoded.t());
            encoded_grads[c] = at::mm(w0.t(), hidden_grad);
        });
        Tensor table_grad = at::zeros_like(table);
        std::vector<HashGridChunk<float>> chunks;
        for (std::int64_t c = 0; c < chunk_count(n); ++c)
            chunks.push_back({values(saved[4 * c]), values(encoded_grads[c])});
        hash_grid_backward<float>(network->grid, chunks, mutable_values(table_grad), torch_parallel_for);
        return {Variable(), Variable(), table_grad, sum_in_order(grads0, w0), sum_in_order(grads1, w1)};
    }
};

class ColorFunction : public torch::autograd::Function<ColorFunction> {
  public:
    static variable_list forward(AutogradContext* context, std::int64_t sh_degree, const Variable& features,
                                 const Variable& directions, const Variable& w0, const Variable& w1,
                                 const Variable& w2) {
        const std::int64_t n = features.size(0), basis = sh_degree * sh_degree;
        Tensor color = at::empty({n, 3}, features.options());
        const bool keep = context != nullptr;
        Saved saved(keep ? 4 * chunk_count(n) : 0);
        for_each_chunk(n, [&](std::int64_t c, std::int64_t first, std::int64_t count) {
            Tensor input = at::empty({basis + features.size(1), count}, features.options());
            const Tensor direction = directions.narrow(0, first, count).t().contiguous();
            spherical_harmonics<float>(static_cast<int>(sh_degree), values(direction),
                                       mutable_values(input.narrow(0, 0, basis)));
            input.narrow(0, basis, features.size(1)).copy_(features.narrow(0, first, count).t());
            Tensor hidden0 = at::mm(w0, input).relu_(), hidden1 = at::mm(w1, hidden0).relu_();
            Tensor out = at::mm(w2, hidden1).sigmoid_();
            color.narrow(0, first, count).copy_(out.t());
            if (!keep) return;
            saved[4 * c] = input;
            saved[4 * c + 1] = hidden0;
            saved[4 * c + 2] = hidden1;
            saved[4 * c + 3] = out;
        });
        if (keep) {
            context->save_for_backward({w0, w1, w2});
            context->saved_data["chunks"] = saved;
            context->saved_data["samples"] = n;
            context->saved_data["basis"] = basis;
        }
        return {color};
    }

    static variable_list backward(AutogradContext* context, variable_list grads) {
        at::NoGradGuard no_grad;
        const variable_list tensors = context->get_saved_variables();
        const Tensor &w0 = tensors[0], &w1 = tensors[1], &w2 = tensors[2];
        const Saved saved = context->saved_data["chunks"].toTensorVector();
        const std::int64_t n = context->saved_data["samples"].toInt(), basis = context->saved_data["basis"].toInt();
        const std::int64_t feature_size = w0.size(1) - basis;
        const Tensor feature_weights = w0.narrow(1, basis, feature_size);
        std::vector<Tensor> grads0(chunk_count(n)), grads1(chunk_count(n)), grads2(chunk_count(n));
        Tensor features_grad = at::empty({feature_size, n}, w0.options());
        for_each_chunk(n, [&](std::int64_t c, std::int64_t first, std::int64_t count) {
            const Tensor &input = saved[4 * c], &hidden0 = saved[4 * c + 1], &hidden1 = saved[4 * c + 2];
            const Tensor grad =
                at::sigmoid_backward(grads[0].narrow(0, first, count).t(), saved[4 * c + 3]).contiguous();
            grads2[c] = at::mm(grad, hidden1.t());
            Tensor back1 = at::mm(w2.t(), grad);
            at::threshold_backward_out(back1, back1, hidden1, 0);
            grads1[c] = at::mm(back1, hidden0.t());
            Tensor back0 = at::mm(w1.t(), back1);
            at::threshold_backward_out(back0, back0, hidden0, 0);
            grads0[c] = at::mm(back0, input.t());
            Tensor out = features_grad.narrow(1, first, count);
            at::mm_out(out, feature_weights.t(), back0);
        });
        return {Variable(),
                features_grad.t(),
                Variable(),
                sum_in_order(grads0, w0),
                sum_in_order(grads1, w1),
                sum_in_order(grads2, w2)};
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
