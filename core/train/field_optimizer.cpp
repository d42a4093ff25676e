#include "core/train/field_optimizer.h"

#include "core/base/errors.h"
#include "core/base/spans.h"
#include "core/field/torch_parallel.h"
#include "core/kernels/adam_ref.h"

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

bool FieldOptimizer::step(const RadianceField& field, double rate) {
    at::NoGradGuard no_grad;
    bool finite = true;
    for (const auto& [name, parameter] : field.parameters()) {
        const Tensor& grad = parameter.grad();
        finite = finite && (!grad.defined() || all_finite<float>(values(grad), torch_parallel_for));
    }
    if (finite) ++steps_;
    for (const auto& [name, parameter] : field.parameters()) {
        Tensor& grad = parameter.mutable_grad();
        if (!grad.defined()) continue;
        if (finite) {
            AdamStep step;
            step.rate = rate;
            step.t = steps_;
            step.skip_zero = name == table_name;
            adam_step<float>(step, values(grad), mutable_values(parameter), mutable_values(m_.at(name)),
                             mutable_values(v_.at(name)), torch_parallel_for);
        }
        grad.reset();
    }
    return finite;
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
