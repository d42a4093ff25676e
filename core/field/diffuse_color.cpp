#include "core/field/diffuse_color.h"

#include <cmath>
#include <numbers>

#include "core/base/errors.h"

namespace fieldgraft {
namespace {

constexpr std::int64_t evaluations_a_chunk = 1 << 17;  // samples × directions

}  // namespace

Tensor view_directions_of(const FieldGeometry& geometry, int count) {
    if (count < 1) throw std::invalid_argument(fmt::format("{} view directions: at least 1 is needed", count));
    const auto& up = geometry.up;
    const double length = std::hypot(up[0], up[1], up[2]);
    if (!(length > 0)) throw std::invalid_argument("the field's up axis has length 0");
    const Tensor z = torch::tensor({up[0] / length, up[1] / length, up[2] / length}, at::kDouble);
    const int flattest = static_cast<int>(z.abs().argmin().item<std::int64_t>());
    Tensor x = at::zeros({3}, at::kDouble);
    x[flattest] = 1.0;
    x = x - (x * z).sum() * z;
    x = x / x.norm();
    const Tensor y = at::linalg_cross(z, x);
    // Even by area: heights at equal steps, azimuths by the golden angle. A ray looks down from where its camera is.
    const Tensor step = (at::arange(count, at::kDouble) + 0.5) / count;
    const Tensor height = geometry.forward_facing ? 1 - 2 * step : step;
    const Tensor around = (1 - height.square()).clamp_min(0).sqrt();
    const Tensor angle = at::arange(count, at::kDouble) * (std::numbers::pi * (3 - std::sqrt(5.0)));
    const Tensor camera =
        at::outer(around * angle.cos(), x) + at::outer(around * angle.sin(), y) + at::outer(height, z);
    return (-camera).to(at::kFloat).contiguous();
}

Tensor diffuse_color(const RadianceField& field, const Tensor& features) {
    at::NoGradGuard no_grad;
    const Tensor directions = view_directions_of(field.geometry());
    const std::int64_t n = features.size(0), d = directions.size(0),
                       step = std::max<std::int64_t>(1, evaluations_a_chunk / d);
    Tensor color = at::empty({n, 3}, at::kFloat);
    for (std::int64_t first = 0; first < n; first += step) {
        const std::int64_t count = std::min(step, n - first);
        const Tensor repeated = features.narrow(0, first, count).repeat_interleave(d, 0);
        const Tensor seen = field.color(repeated, directions.repeat({count, 1})).view({count, d, 3});
        color.narrow(0, first, count).copy_(seen.mean(1));
    }
    return color;
}

}  // namespace fieldgraft
