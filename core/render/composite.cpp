#include "core/kernels/composite_ref.h"

#include "core/base/errors.h"
#include "core/base/shape.h"
#include "core/field/torch_parallel.h"
#include "core/render/blend.h"

namespace fieldgraft {
namespace {

using torch::autograd::AutogradContext;
using torch::autograd::Variable;
using torch::autograd::variable_list;

template <class T>
std::span<const T> view(const Tensor& tensor) {
    return {tensor.const_data_ptr<T>(), static_cast<std::size_t>(tensor.numel())};
}
template <class T>
std::span<T> mutable_view(const Tensor& tensor) {
    return {tensor.mutable_data_ptr<T>(), static_cast<std::size_t>(tensor.numel())};
}

template <class T>
CompositeInput<T> input_of(const variable_list& in) {
    return {view<std::int64_t>(in[0]), view<T>(in[1]), view<T>(in[2]), view<T>(in[3]), view<T>(in[4])};
}

// in: start, delta, t, density, color; all contiguous.
variable_list forward_all(const variable_list& in) {
    const std::int64_t rays = in[0].size(0) - 1;
    const Tensor color = at::empty({rays, 3}, in[3].options()), transmittance = at::empty({rays}, in[3].options());
    const Tensor depth = at::empty({rays}, in[3].options());
    AT_DISPATCH_FLOATING_TYPES(in[3].scalar_type(), "composite", [&] {
        composite_forward<scalar_t>(input_of<scalar_t>(in), mutable_view<scalar_t>(color),
                                    mutable_view<scalar_t>(transmittance), mutable_view<scalar_t>(depth),
                                    torch_parallel_for);
    });
    return {color, transmittance, depth};
}

class CompositeFunction : public torch::autograd::Function<CompositeFunction> {
  public:
    static variable_list forward(AutogradContext* context, const Variable& start, const Variable& delta,
                                 const Variable& t, const Variable& density, const Variable& color) {
        context->save_for_backward({start, delta, t, density, color});
        variable_list out = forward_all({start, delta, t, density, color});
        context->mark_non_differentiable({out[2]});
        return out;
    }

    static variable_list backward(AutogradContext* context, variable_list grads) {
        at::NoGradGuard no_grad;
        const variable_list in = context->get_saved_variables();
        const Tensor density_grad = at::empty_like(in[3]), color_grad = at::empty_like(in[4]);
        const Tensor out_grad = grads[0].contiguous(), transmittance_grad = grads[1].contiguous();
        AT_DISPATCH_FLOATING_TYPES(in[3].scalar_type(), "composite", [&] {
            composite_backward<scalar_t>(input_of<scalar_t>(in), view<scalar_t>(out_grad),
                                         view<scalar_t>(transmittance_grad), mutable_view<scalar_t>(density_grad),
                                         mutable_view<scalar_t>(color_grad), torch_parallel_for);
        });
        return {Variable(), Variable(), Variable(), density_grad, color_grad};
    }
};

void check(const Tensor& start, const variable_list& samples) {
    if (start.dim() != 1 || start.size(0) < 1 || start.scalar_type() != at::kLong) {
        throw std::invalid_argument("composite: start must be int64 R+1, not " + shape_text(start));
    }
    const Tensor& density = samples[2];
    const bool floating = density.scalar_type() == at::kFloat || density.scalar_type() == at::kDouble;
    if (!floating || density.dim() != 1) {
        throw std::invalid_argument("composite: density must be float32 or float64 N, not " + shape_text(density));
    }
    for (const Tensor& tensor : samples) {
        if (tensor.scalar_type() != density.scalar_type()) {
            throw std::invalid_argument("composite: all samples must have the type of density");
        }
    }
}

}  // namespace

CompositeOut composite(const Tensor& start, const Tensor& delta, const Tensor& t, const Tensor& density,
                       const Tensor& color) {
    check(start, {delta, t, density, color});
    const variable_list in{start.contiguous(), delta.contiguous(), t.contiguous(), density.contiguous(),
                           color.contiguous()};
    const bool record = at::GradMode::is_enabled() && (density.requires_grad() || color.requires_grad());
    const variable_list out = record ? CompositeFunction::apply(in[0], in[1], in[2], in[3], in[4]) : forward_all(in);
    return {out[0], out[1], out[2]};
}

}  // namespace fieldgraft
