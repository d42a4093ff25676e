#include "core/render/blend.h"

#include "core/base/errors.h"
#include "core/kernels/blend_ref.h"
#include "core/kernels/exp_simd.h"

namespace fieldgraft {
namespace {

using torch::autograd::AutogradContext;
using torch::autograd::variable_list;
using OptionalTensor = std::optional<Tensor>;

constexpr std::int64_t rays_per_task = 256;

enum Input {
    start_in,
    delta_in,
    density_o_in,
    color_o_in,
    density_e_in,
    color_e_in,
    beta_density_in,
    beta_color_in,
    inputs
};

// The outputs that a mode has, in this order; the others do not exist.
enum Output {
    color_out,
    transmittance_out,
    color_edit_out,
    alpha_edit_out,
    added_out,
    removed_out,
    changed_out,
    outputs
};

std::vector<Output> outputs_of(const BlendMode& mode) {
    std::vector<Output> all{color_out, transmittance_out};
    if (mode.add || mode.change) all.insert(all.end(), {color_edit_out, alpha_edit_out});
    if (mode.add) all.push_back(added_out);
    if (mode.remove) all.push_back(removed_out);
    if (mode.change) all.push_back(changed_out);
    return all;
}

template <class Real>
Real* data_or_null(const Tensor& tensor) {
    return tensor.defined() ? tensor.data_ptr<Real>() : nullptr;
}

template <class Real>
BlendInputs<Real> kernel_inputs(const std::array<Tensor, inputs>& in) {
    return {in[start_in].data_ptr<std::int64_t>(),   data_or_null<Real>(in[delta_in]),
            data_or_null<Real>(in[density_o_in]),    data_or_null<Real>(in[color_o_in]),
            data_or_null<Real>(in[density_e_in]),    data_or_null<Real>(in[color_e_in]),
            data_or_null<Real>(in[beta_density_in]), data_or_null<Real>(in[beta_color_in])};
}

template <class Real>
BlendRays<Real> kernel_rays(const std::array<Tensor, outputs>& rays) {
    const auto data = [&](Output output) { return data_or_null<std::remove_const_t<Real>>(rays[output]); };
    return {data(color_out), data(transmittance_out), data(color_edit_out), data(alpha_edit_out),
            data(added_out), data(removed_out),       data(changed_out)};
}

// In training, vectors of exponentials; for a picture the library's, so that what no edit touches keeps its bits.
template <class Real>
const BlendMath<Real>& training_math() {
    if constexpr (std::is_same_v<Real, float>) {
        static const BlendMath<float> math{exp_negative, one_minus_exp_negative};
        return math;
    } else {
        return library_math<Real>();
    }
}

struct BlendFunction : torch::autograd::Function<BlendFunction> {
    static variable_list forward(AutogradContext* ctx, const Tensor& start, const Tensor& delta,
                                 const Tensor& density_o, const Tensor& color_o, const OptionalTensor& density_e,
                                 const OptionalTensor& color_e, const OptionalTensor& beta_density,
                                 const OptionalTensor& beta_color, BlendMode mode, bool training) {
        const std::array<Tensor, inputs> in{start,
                                            delta,
                                            density_o,
                                            color_o,
                                            density_e.value_or(Tensor()),
                                            color_e.value_or(Tensor()),
                                            beta_density.value_or(Tensor()),
                                            beta_color.value_or(Tensor())};
        ctx->save_for_backward({in.begin(), in.end()});
        ctx->saved_data["mode"] = std::vector<bool>{mode.add, mode.remove, mode.change, mode.conserving, mode.visible};
        ctx->set_materialize_grads(false);

        const std::int64_t rays = start.size(0) - 1;
        std::array<Tensor, outputs> out;
        variable_list result;
        for (const Output output : outputs_of(mode)) {
            const bool is_color = output == color_out || output == color_edit_out;
            out[output] = is_color ? at::empty({rays, 3}, delta.options()) : at::empty({rays}, delta.options());
            result.push_back(out[output]);
        }
        AT_DISPATCH_FLOATING_TYPES(delta.scalar_type(), "blend", [&] {
            const auto kernel_in = kernel_inputs<scalar_t>(in);
            const auto kernel_out = kernel_rays<scalar_t>(out);
            const auto& math = training ? training_math<scalar_t>() : library_math<scalar_t>();
            at::parallel_for(0, rays, rays_per_task, [&](std::int64_t begin, std::int64_t end) {
                blend_forward(mode, kernel_in, kernel_out, begin, end, math);
            });
        });
        return result;
    }

    static variable_list backward(AutogradContext* ctx, const variable_list& grads) {
        const auto saved = ctx->get_saved_variables();
        std::array<Tensor, inputs> in;
        std::copy(saved.begin(), saved.end(), in.begin());
        const auto flags = ctx->saved_data["mode"].toBoolList();
        const BlendMode mode{flags[0], flags[1], flags[2], flags[3], flags[4]};

        std::array<Tensor, outputs> out_grads;
        const std::vector<Output> present = outputs_of(mode);
        for (std::size_t i = 0; i < present.size(); ++i) {
            if (grads[i].defined()) out_grads[present[i]] = grads[i].contiguous();
        }
        variable_list in_grads(inputs + 2);  // two for the mode and the math
        for (int i = density_e_in; i < inputs; ++i) {
            if (in[i].defined()) in_grads[i] = at::empty_like(in[i]);
        }
        AT_DISPATCH_FLOATING_TYPES(in[delta_in].scalar_type(), "blend_backward", [&] {
            const auto kernel_in = kernel_inputs<scalar_t>(in);
            const auto kernel_grads = kernel_rays<const scalar_t>(out_grads);
            const BlendHeads<scalar_t> heads{
                data_or_null<scalar_t>(in_grads[density_e_in]), data_or_null<scalar_t>(in_grads[color_e_in]),
                data_or_null<scalar_t>(in_grads[beta_density_in]), data_or_null<scalar_t>(in_grads[beta_color_in])};
            at::parallel_for(0, in[start_in].size(0) - 1, rays_per_task, [&](std::int64_t begin, std::int64_t end) {
                blend_backward(mode, kernel_in, kernel_grads, heads, begin, end, training_math<scalar_t>());
            });
        });
        return in_grads;
    }
};

void check_shape(const char* name, const Tensor& tensor, at::IntArrayRef shape, at::ScalarType type) {
    if (!tensor.defined()) throw std::invalid_argument(fmt::format("blend: {} is not defined", name));
    if (tensor.sizes() == shape && tensor.scalar_type() == type && tensor.device().is_cpu()) return;
    throw std::invalid_argument(fmt::format("blend: {} is {} {}, expected {} {} on the CPU", name,
                                            c10::toString(tensor.scalar_type()), c10::str(tensor.sizes()),
                                            c10::toString(type), c10::str(shape)));
}

void check_start(const Tensor& start, std::int64_t samples) {
    if (!start.defined() || start.dim() != 1 || start.size(0) < 1 || start.scalar_type() != at::kLong) {
        throw std::invalid_argument("blend: start must be R+1 int64");
    }
    const auto at = start.accessor<std::int64_t, 1>();
    bool sorted = at[0] == 0 && at[at.size(0) - 1] == samples;
    for (std::int64_t r = 1; r < at.size(0); ++r) sorted = sorted && at[r - 1] <= at[r];
    if (!sorted) throw std::invalid_argument(fmt::format("blend: start must rise from 0 to {} samples", samples));
}

// Which operations the defined heads make up.
BlendMode mode_of(const EditSamples& edit, const BlendOptions& options) {
    BlendMode mode;
    mode.add = edit.density_e.defined();
    mode.remove = edit.beta_density.defined();
    mode.change = edit.beta_color.defined();
    mode.conserving = options.compositing == Compositing::conserving;
    mode.visible = options.removed == RemovedMap::visible;
    if (!mode.add && !mode.remove && !mode.change) throw std::invalid_argument("blend: the edit has no head");
    if ((mode.add || mode.change) != edit.color_e.defined()) {
        throw std::invalid_argument("blend: color_e goes with density_e or beta_color, and only with them");
    }
    return mode;
}

OptionalTensor head(const Tensor& tensor) {
    return tensor.defined() ? OptionalTensor(tensor.contiguous()) : std::nullopt;
}

}  // namespace

BlendOut blend(const Tensor& start, const Tensor& delta, const Tensor& density_o, const Tensor& color_o,
               const EditSamples& edit, const BlendOptions& options) {
    if (!delta.defined() || delta.dim() != 1 ||
        (delta.scalar_type() != at::kFloat && delta.scalar_type() != at::kDouble)) {
        throw std::invalid_argument("blend: delta must be N float32 or float64");
    }
    const std::int64_t samples = delta.size(0);
    const at::ScalarType type = delta.scalar_type();
    const BlendMode mode = mode_of(edit, options);
    check_start(start, samples);
    check_shape("delta", delta, {samples}, type);
    check_shape("density_o", density_o, {samples}, type);
    check_shape("color_o", color_o, {samples, 3}, type);
    if (mode.add) check_shape("density_e", edit.density_e, {samples}, type);
    if (edit.color_e.defined()) check_shape("color_e", edit.color_e, {samples, 3}, type);
    if (mode.remove) check_shape("beta_density", edit.beta_density, {samples}, type);
    if (mode.change) check_shape("beta_color", edit.beta_color, {samples}, type);

    const auto learns = [](const Tensor& head) { return head.defined() && head.requires_grad(); };
    const bool training = at::GradMode::is_enabled() && (learns(edit.density_e) || learns(edit.color_e) ||
                                                         learns(edit.beta_density) || learns(edit.beta_color));
    const variable_list result = BlendFunction::apply(
        start.contiguous(), delta.detach().contiguous(), density_o.detach().contiguous(), color_o.detach().contiguous(),
        head(edit.density_e), head(edit.color_e), head(edit.beta_density), head(edit.beta_color), mode, training);
    BlendOut out;
    Tensor* const fields[outputs] = {&out.color, &out.transmittance, &out.color_edit, &out.alpha_edit,
                                     &out.added, &out.removed,       &out.changed};
    const std::vector<Output> present = outputs_of(mode);
    for (std::size_t i = 0; i < present.size(); ++i) *fields[present[i]] = result[i];
    return out;
}

}  // namespace fieldgraft
