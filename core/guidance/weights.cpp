#include "core/guidance/weights.h"

#include <spdlog/fmt/ranges.h>

#include "core/base/errors.h"

namespace fieldgraft {

Weights::Weights(std::shared_ptr<const SafeTensors> file, torch::ScalarType type, torch::Device device)
    : file_(std::move(file)), type_(type), device_(device) {}

Weights Weights::below(const std::string& prefix) const {
    Weights out = *this;
    out.prefix_ += prefix;
    return out;
}

Weights Weights::as(torch::ScalarType type) const {
    Weights out = *this;
    out.type_ = type;
    return out;
}

bool Weights::has(const std::string& name) const {
    return file_->tensors.contains(prefix_ + name);
}

Tensor Weights::take(const std::string& name, std::vector<std::int64_t> shape) const {
    const auto found = file_->tensors.find(prefix_ + name);
    if (found == file_->tensors.end())
        input_error("{}: the tensor '{}' is missing (config.json asks for it with shape [{}])", file_->origin,
                    prefix_ + name, fmt::join(shape, ", "));
    const Tensor& tensor = found->second;
    if (tensor.sizes() != at::IntArrayRef(shape))
        input_error("{}: the tensor '{}' has shape [{}], config.json asks for [{}]", file_->origin, prefix_ + name,
                    fmt::join(tensor.sizes(), ", "), fmt::join(shape, ", "));
    if (!tensor.is_floating_point())
        input_error("{}: the tensor '{}' holds integers, must be float16, bfloat16 or float32", file_->origin,
                    prefix_ + name);
    return tensor.to(device_, type_).detach();
}

}  // namespace fieldgraft
