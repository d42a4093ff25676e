#include "core/render/ray_pass.h"

#include <algorithm>
#include <cmath>

#include "core/kernels/composite_ref.h"
#include "core/render/block_colors.h"

namespace fieldgraft {
namespace {

constexpr float same_as_background = 0.03f, empty_weight = 0.05f;

// What is computed of one block, kept from block to block for its memory.
struct Activations : BlockColors {
    std::vector<float> shown, transmittance, depth;  // of the rays
    std::vector<float> shown_grad, transmittance_grad, density_grad, color_grad;
    std::vector<float> base_grad, features_grad, encoded_grad;
};

CompositeInput<float> composite_input(const RayBlock& block, const Activations& a) {
    return {block.start, block.delta, block.t, block.density, a.color};
}

void forward(const KernelField& field, const RayBlock& block, Activations& a) {
    const std::size_t rays = block.rays();
    a.compute(field, block);
    a.shown.resize(3 * rays);
    a.transmittance.resize(rays);
    a.depth.resize(rays);
    composite_forward<float>(composite_input(block, a), a.shown, a.transmittance, a.depth, serial_for);
}

// The loss and its gradient with respect to what the rays show; scale: one over the number of values in the mean.
double difference_over(const std::array<float, 3>& background, std::span<const float> pixels, float scale,
                       Activations& a) {
    double sum = 0;
    for (std::size_t r = 0; r < a.transmittance.size(); ++r) {
        const float* pixel = pixels.data() + 4 * r;
        bool nothing = true;
        for (std::size_t c = 0; c < 3; ++c) {
            const float behind = background[c], seen = pixel[3] * pixel[c] + (1 - pixel[3]) * behind;
            const float color = a.shown[3 * r + c] + a.transmittance[r] * behind - seen;
            sum += static_cast<double>(color * color);
            a.shown_grad[3 * r + c] = 2 * color * scale;
            a.transmittance_grad[r] += 2 * color * behind * scale;
            nothing = nothing && std::abs(seen - behind) <= same_as_background;
        }
        if (nothing) a.transmittance_grad[r] -= 3 * empty_weight * 2 * (1 - a.transmittance[r]) * scale;
    }
    return sum;
}

double difference(std::span<const float> pixels, const PlainBackground& background, float scale, Activations& a) {
    double sum = 0;
    a.shown_grad.resize(a.shown.size());
    a.transmittance_grad.assign(a.transmittance.size(), 0.0f);
    if (background) return difference_over(*background, pixels, scale, a);
    for (std::size_t i = 0; i < a.shown.size(); ++i) {
        const float* pixel = pixels.data() + i / 3 * 4;
        const float color = a.shown[i] - pixel[3] * pixel[i % 3];
        const float transmittance = a.transmittance[i / 3] - (1 - pixel[3]);
        sum += static_cast<double>(color * color + color * transmittance + transmittance * transmittance / 3);
        a.shown_grad[i] = (2 * color + transmittance) * scale;
        a.transmittance_grad[i / 3] += (color + 2 * transmittance / 3) * scale;
    }
    return sum;
}

void backward(const KernelField& field, const RayBlock& block, Activations& a, FieldMlpGradients& gradients) {
    const std::size_t n = block.samples(), rays = block.rays();
    const int count = static_cast<int>(n);
    a.density_grad.resize(n);
    a.color_grad.resize(3 * n);
    composite_backward<float>(composite_input(block, a), a.shown_grad, a.transmittance_grad, a.density_grad,
                              a.color_grad, serial_for);
    a.base_grad.assign(rays * field.hidden_row, 0.0f);
    a.features_grad.resize(n * field.feature_row);
    a.encoded_grad.resize(n * field.encoded_row);
    color_mlp_backward(field.weights, block.features.data(), block.ray.data(), a.hidden0.data(), a.hidden1.data(),
                       a.color.data(), a.color_grad.data(), count, gradients, a.base_grad.data(),
                       a.features_grad.data());
    ray_color_base_backward(field.weights, block.basis.data(), a.base_grad.data(), static_cast<int>(rays), gradients);
    for (std::size_t i = 0; i < n; ++i) a.features_grad[i * field.feature_row] += a.density_grad[i] * block.density[i];
    density_mlp_backward(field.weights, block.encoded.data(), a.features_grad.data(), count, gradients,
                         a.encoded_grad.data());
}

// A block's gradients of the encoding into their places, the first of them being the range's `done`th sample.
void keep(const KernelField& field, const RayBlock& block, const Activations& a, std::size_t done, RangeFit& fit) {
    const std::size_t n = block.samples(), width = static_cast<std::size_t>(field.grid->features);
    for (int c = 0; c < 3; ++c) {
        std::copy_n(block.positions.data() + c * n, n, fit.positions.get() + c * fit.samples + done);
    }
    // 0 · x is 0 for every finite x and NaN for the others.
    float zero = 0;
    for (const float x : a.encoded_grad) zero += 0.0f * x;
    fit.finite = fit.finite && zero == 0;
    for (std::size_t l = 0; l < field.grid->levels.size(); ++l) {
        float* to = fit.encoded_grad.get() + (l * fit.samples + done) * width;
        const float* from = a.encoded_grad.data() + l * width;
        for (std::size_t s = 0; s < n; ++s) std::copy_n(from + s * field.encoded_row, width, to + s * width);
    }
}

}  // namespace

void draw_range(const KernelField& field, const MarchGrid& cells, const RayRange& rays, std::span<float> color,
                std::span<float> transmittance, std::span<float> depth) {
    VisibleRays visible(field, cells, rays, VisibleRays::Encoded::dropped);
    RayBlock block;
    Activations a;
    while (visible.next(block)) {
        forward(field, block, a);
        const std::size_t first = rays.first + block.begin;
        std::copy(a.shown.begin(), a.shown.end(), color.begin() + 3 * first);
        std::copy(a.transmittance.begin(), a.transmittance.end(), transmittance.begin() + first);
        std::copy(a.depth.begin(), a.depth.end(), depth.begin() + first);
    }
}

HashGridRows RangeFit::rows(const HashGrid& grid) const {
    const std::size_t features = static_cast<std::size_t>(grid.features);
    return {positions.get(), encoded_grad.get(), samples, features, samples * features};
}

void fit_range(const KernelField& field, const MarchGrid& cells, const RayRange& rays, std::span<const float> pixels,
               const PlainBackground& background, RangeFit& fit) {
    VisibleRays visible(field, cells, rays);
    fit.samples = visible.samples();
    fit.positions = std::make_unique_for_overwrite<float[]>(3 * fit.samples);
    fit.encoded_grad = std::make_unique_for_overwrite<float[]>(fit.samples * field.grid->rows());
    const float scale = static_cast<float>(1.0 / static_cast<double>(rays.march.origins.size()));
    RayBlock block;
    Activations a;
    std::size_t done = 0;
    while (visible.next(block)) {
        forward(field, block, a);
        const std::size_t first = rays.first + block.begin, count = block.rays();
        fit.squared_error += difference(pixels.subspan(4 * first, 4 * count), background, scale, a);
        backward(field, block, a, fit.gradients);
        keep(field, block, a, done, fit);
        done += block.samples();
    }
}

}  // namespace fieldgraft
