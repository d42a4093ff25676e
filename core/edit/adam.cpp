#include "core/edit/adam.h"

#include <cmath>

#include "core/base/errors.h"

namespace fieldgraft {

Adam::Adam(const std::map<std::string, Tensor>& parameters, double beta1, double beta2, double epsilon)
    : parameters_(parameters), beta1_(beta1), beta2_(beta2), epsilon_(epsilon) {
    for (const auto& [name, parameter] : parameters_) {
        first_[name] = at::zeros_like(parameter);
        second_[name] = at::zeros_like(parameter);
    }
}

bool Adam::step(double learning_rate) {
    at::NoGradGuard no_gradients;
    // The sum of squares is finite only if every entry is (float32 squares overflow only far beyond any sane gradient).
    bool finite = true;
    for (const auto& [name, parameter] : parameters_)
        if (parameter.grad().defined())
            finite = finite && std::isfinite(parameter.grad().square().sum().item<double>());
    if (finite) {
        ++steps_;
        const double first_share = 1 - std::pow(beta1_, static_cast<double>(steps_));
        const double second_share = 1 - std::pow(beta2_, static_cast<double>(steps_));
        for (auto& [name, parameter] : parameters_) {
            const Tensor gradient = parameter.grad();
            if (!gradient.defined()) continue;
            first_[name].mul_(beta1_).add_(gradient, 1 - beta1_);
            second_[name].mul_(beta2_).addcmul_(gradient, gradient, 1 - beta2_);
            const Tensor root = (second_[name] / second_share).sqrt_().add_(epsilon_);
            parameter.addcdiv_(first_[name], root, -learning_rate / first_share);
        }
    }
    for (auto& [name, parameter] : parameters_) parameter.mutable_grad() = Tensor();
    return finite;
}

std::map<std::string, Tensor> Adam::state() const {
    std::map<std::string, Tensor> state{{"steps", at::tensor({steps_}, at::kLong)}};
    for (const auto& [name, moment] : first_) state["m." + name] = moment;
    for (const auto& [name, moment] : second_) state["v." + name] = moment;
    return state;
}

void Adam::restore(const std::map<std::string, Tensor>& state) {
    const auto take = [&](const std::string& name) -> const Tensor& {
        const auto found = state.find(name);
        if (found == state.end()) input_error("checkpoint: \"{}\" is missing; it belongs to another edit", name);
        return found->second;
    };
    for (auto* moments : {&first_, &second_}) {
        for (auto& [name, moment] : *moments) {
            const Tensor& saved = take(fmt::format("{}.{}", moments == &first_ ? "m" : "v", name));
            if (saved.sizes() != moment.sizes())
                input_error("checkpoint: \"{}\" has another shape; it belongs to another edit", name);
            moment.copy_(saved);
        }
    }
    steps_ = take("steps").item<std::int64_t>();
}

}  // namespace fieldgraft
