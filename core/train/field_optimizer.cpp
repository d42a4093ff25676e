#include "core/train/field_optimizer.h"

#include <cmath>

#include "core/base/errors.h"
#include "core/base/spans.h"
#include "core/field/hash_network.h"
#include "core/field/torch_parallel.h"
#include "core/kernels/adam_simd.h"

namespace fieldgraft {
namespace {

constexpr const char* table_name = "encoding.table";

}  // namespace

FieldOptimizer::FieldOptimizer(const RadianceField& field) {
    for (const auto& [name, parameter] : field.parameters()) {
        m_[name] = at::zeros(parameter.sizes(), at::kFloat);
        v_[name] = at::zeros(parameter.sizes(), at::kFloat);
    }
}

// Entries [first, first + grad.size()) of a parameter, in the caller's thread.
void FieldOptimizer::step_part(const RadianceField& field, const std::string& name, AdamStep step, std::size_t first,
                               std::span<const float> grad) {
    step.skip_zero = name == table_name;
    const auto part = [&](const Tensor& whole) { return mutable_values(whole).subspan(first, grad.size()); };
    adam_step_part(step, grad, part(field.parameters().at(name)), part(m_.at(name)), part(v_.at(name)));
}

bool FieldOptimizer::step(const RadianceField& field, double rate, const std::vector<RangeFit>& fits) {
    const FieldMlpShape shape = field.mlp_shape();
    FieldMlpGradients total(shape);
    bool finite = true;
    for (const RangeFit& fit : fits) {
        total.add(fit.gradients);
        finite = finite && fit.finite && std::isfinite(fit.squared_error);
    }
    std::vector<std::vector<float>> grads;
    for (const char* name : field_matrix_names) grads.emplace_back(field.parameters().at(name).numel(), 0.0f);
    total.add_to(shape, std::vector<std::span<float>>(grads.begin(), grads.end()));
    for (const auto& grad : grads) finite = finite && all_finite<float>(grad, serial_for);
    if (!finite) return false;

    AdamStep step;
    step.rate = rate;
    step.t = steps_ + 1;
    for (std::size_t i = 0; i < grads.size(); ++i) step_part(field, field_matrix_names[i], step, 0, grads[i]);
    const HashGrid& grid = field.network().grid;
    std::vector<HashGridRows> rows;
    for (const RangeFit& fit : fits) rows.push_back(fit.rows(grid));
    // The finest levels first: they cost most, and what is left at the end should be short.
    share_out(static_cast<std::int64_t>(grid.levels.size()), [&](std::int64_t i) {
        const std::size_t l = grid.levels.size() - 1 - static_cast<std::size_t>(i);
        const HashGridLevel& level = grid.levels[l];
        thread_local std::vector<float> grad;
        grad.assign(std::size_t{level.entries} * grid.features, 0.0f);
        hash_grid_add_gradient(grid, static_cast<int>(l), rows, grad.data());
        step_part(field, table_name, step, level.offset * grid.features, grad);
    });
    ++steps_;
    return true;
}

std::map<std::string, Tensor> FieldOptimizer::moments() const {
    std::map<std::string, Tensor> all;
    for (const auto& [name, moment] : m_) all["m." + name] = moment;
    for (const auto& [name, moment] : v_) all["v." + name] = moment;
    return all;
}

void FieldOptimizer::restore(const std::map<std::string, Tensor>& moments, std::int64_t steps) {
    for (auto* own : {&m_, &v_}) {
        for (auto& [name, moment] : *own) {
            const std::string key = (own == &m_ ? "m." : "v.") + name;
            const auto found = moments.find(key);
            if (found == moments.end() || found->second.sizes() != moment.sizes()) {
                input_error("checkpoint: \"{}\" is missing or has the wrong size", key);
            }
            moment.copy_(found->second);
        }
    }
    steps_ = steps;
}

}  // namespace fieldgraft
