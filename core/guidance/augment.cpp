#include "core/guidance/augment.h"

#include <spdlog/fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/base/errors.h"

namespace fieldgraft {
namespace {

constexpr std::array<std::array<double, 2>, 4> unit_corners{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};

void check(const AugmentSettings& s) {
    const auto within = [](const char* name, double value, double low, double high) {
        if (!(value >= low && value <= high))
            throw std::invalid_argument(
                fmt::format("AugmentSettings::{} is {}, must be from {} to {}", name, value, low, high));
    };
    within("copies", s.copies, 1, 4096);
    within("brightness", s.colour.brightness, 0, 1);
    within("contrast", s.colour.contrast, 0, 1);
    within("saturation", s.colour.saturation, 0, 1);
    within("translation", s.translation, 0, 1);
    within("cutout", s.cutout, 0, 1);
    within("perspective", s.perspective, 0, 0.95);
    within("perspective_chance", s.perspective_chance, 0, 1);
}

double uniform(Random& random, double low, double high) {
    return random.uniform(static_cast<float>(low), static_cast<float>(high));
}

Augmentation draw(const AugmentSettings& s, Random& random) {
    Augmentation out;
    out.brightness = uniform(random, -s.colour.brightness, s.colour.brightness);
    out.saturation = 1 + uniform(random, -s.colour.saturation, s.colour.saturation);
    out.contrast = 1 + uniform(random, -s.colour.contrast, s.colour.contrast);
    for (double& shift : out.shift) shift = uniform(random, -s.translation, s.translation);
    out.cutout = s.cutout;
    for (double& centre : out.cutout_at) centre = random.uniform();
    // Always drawn, so that a chance or a range changes nothing in the draws that follow.
    const bool warp = random.uniform() < s.perspective_chance;
    for (int k = 0; k < 4; ++k)
        for (int axis = 0; axis < 2; ++axis) {
            const double inwards = uniform(random, 0, 0.5 * s.perspective);
            if (warp) out.corners[k][axis] += unit_corners[k][axis] > 0 ? -inwards : inwards;
        }
    return out;
}

// One number a copy, as N×1×1×1 in the picture's type.
template <class Get>
Tensor column(const std::vector<Augmentation>& augmentations, const Tensor& like, Get get) {
    std::vector<double> values;
    for (const Augmentation& a : augmentations) values.push_back(get(a));
    return at::tensor(values, torch::kDouble).to(like.device(), like.scalar_type()).view({-1, 1, 1, 1});
}

Tensor colour(const Tensor& image, const std::vector<Augmentation>& augmentations) {
    Tensor x = image + column(augmentations, image, [](const Augmentation& a) { return a.brightness; });  // N×3×S×S
    const Tensor grey = x.mean(1, true);
    x = (x - grey) * column(augmentations, image, [](const Augmentation& a) { return a.saturation; }) + grey;
    const Tensor mean = x.mean({1, 2, 3}, true);
    return (x - mean) * column(augmentations, image, [](const Augmentation& a) { return a.contrast; }) + mean;
}

// x is relative to the fill, so that 0 is what comes in from outside.
Tensor shift(const Tensor& x, const std::vector<Augmentation>& augmentations) {
    const std::int64_t height = x.size(2), width = x.size(3);
    std::vector<Tensor> out;
    for (std::size_t n = 0; n < augmentations.size(); ++n) {
        const auto dx = std::clamp<std::int64_t>(std::lround(augmentations[n].shift[0] * static_cast<double>(width)),
                                                 -width, width);
        const auto dy = std::clamp<std::int64_t>(std::lround(augmentations[n].shift[1] * static_cast<double>(height)),
                                                 -height, height);
        out.push_back(at::constant_pad_nd(x[static_cast<std::int64_t>(n)], {dx, -dx, dy, -dy}));
    }
    return at::stack(out);
}

Tensor cutout_mask(const Tensor& x, const std::vector<Augmentation>& augmentations) {
    const std::int64_t height = x.size(2), width = x.size(3);
    Tensor mask = at::ones({x.size(0), 1, height, width}, x.options().requires_grad(false));
    for (std::size_t n = 0; n < augmentations.size(); ++n) {
        const Augmentation& a = augmentations[n];
        // First and one past the last pixel of a square of round(side·S) pixels about the centre, cut at the frame.
        const auto span = [&](double centre, std::int64_t size) {
            const auto side = static_cast<std::int64_t>(std::lround(a.cutout * static_cast<double>(size)));
            const auto first = static_cast<std::int64_t>(std::lround(centre * static_cast<double>(size))) - side / 2;
            return std::pair(std::clamp<std::int64_t>(first, 0, size), std::clamp<std::int64_t>(first + side, 0, size));
        };
        const auto [x0, x1] = span(a.cutout_at[0], width);
        const auto [y0, y1] = span(a.cutout_at[1], height);
        if (x0 < x1 && y0 < y1)
            mask[static_cast<std::int64_t>(n)].narrow(1, y0, y1 - y0).narrow(2, x0, x1 - x0).zero_();
    }
    return mask;
}

// Where each output pixel's centre looks, in grid_sample's coordinates (−1 … 1 from edge to edge): S×S×2.
Tensor look_up(const std::array<double, 9>& h, std::int64_t height, std::int64_t width,
               const at::TensorOptions& options) {
    const auto wide = options.dtype(torch::kDouble);
    const Tensor v = ((at::arange(height, wide) + 0.5) / static_cast<double>(height)).view({-1, 1});
    const Tensor u = ((at::arange(width, wide) + 0.5) / static_cast<double>(width)).view({1, -1});
    const Tensor w = h[6] * u + h[7] * v + h[8];
    return at::stack({(h[0] * u + h[1] * v + h[2]) / w * 2 - 1, (h[3] * u + h[4] * v + h[5]) / w * 2 - 1}, -1)
        .to(options.dtype());
}

Tensor warp(const Tensor& x, const std::vector<Augmentation>& augmentations) {
    std::vector<std::int64_t> rows;
    std::vector<Tensor> grids;
    for (std::size_t n = 0; n < augmentations.size(); ++n) {
        if (!augmentations[n].warps()) continue;
        rows.push_back(static_cast<std::int64_t>(n));
        grids.push_back(look_up(corner_homography(augmentations[n].corners), x.size(2), x.size(3),
                                x.options().requires_grad(false)));
    }
    if (rows.empty()) return x;
    const Tensor index = at::tensor(rows, torch::kLong).to(x.device());
    const Tensor warped = at::grid_sampler_2d(x.index_select(0, index), at::stack(grids), 0, 0, false);
    return x.index_copy(0, index, warped);
}

}  // namespace

bool Augmentation::warps() const {
    return corners != unit_corners;
}

std::vector<Augmentation> draw_augmentations(const AugmentSettings& settings, Random& random) {
    check(settings);
    std::vector<Augmentation> out(1);
    for (int n = 1; n < settings.copies; ++n) out.push_back(draw(settings, random));
    return out;
}

std::array<double, 9> corner_homography(const std::array<std::array<double, 2>, 4>& c) {
    // Unit square → quadrilateral in closed form.
    const double sx = c[0][0] - c[1][0] + c[2][0] - c[3][0], sy = c[0][1] - c[1][1] + c[2][1] - c[3][1];
    const double dx1 = c[1][0] - c[2][0], dy1 = c[1][1] - c[2][1], dx2 = c[3][0] - c[2][0], dy2 = c[3][1] - c[2][1];
    const double determinant = dx1 * dy2 - dx2 * dy1;
    if (!(std::abs(determinant) > 1e-12)) throw std::invalid_argument("corner_homography: three corners lie on a line");
    const double g = (sx * dy2 - dx2 * sy) / determinant, h = (dx1 * sy - sx * dy1) / determinant;
    const std::array<double, 9> m{c[1][0] - c[0][0] + g * c[1][0],
                                  c[3][0] - c[0][0] + h * c[3][0],
                                  c[0][0],
                                  c[1][1] - c[0][1] + g * c[1][1],
                                  c[3][1] - c[0][1] + h * c[3][1],
                                  c[0][1],
                                  g,
                                  h,
                                  1};
    // Its inverse up to scale: the adjugate. Corners on a line have none.
    const std::array<double, 9> inverse{
        m[4] * m[8] - m[5] * m[7], m[2] * m[7] - m[1] * m[8], m[1] * m[5] - m[2] * m[4],
        m[5] * m[6] - m[3] * m[8], m[0] * m[8] - m[2] * m[6], m[2] * m[3] - m[0] * m[5],
        m[3] * m[7] - m[4] * m[6], m[1] * m[6] - m[0] * m[7], m[0] * m[4] - m[1] * m[3]};
    const double whole = m[0] * inverse[0] + m[1] * inverse[3] + m[2] * inverse[6];
    if (!(std::abs(whole) > 1e-12)) throw std::invalid_argument("corner_homography: three corners lie on a line");
    return inverse;
}

Tensor augment(const Tensor& image, const std::vector<Augmentation>& augmentations, const Tensor& fill) {
    if (!image.defined() || !(image.dim() == 3 || (image.dim() == 4 && image.size(0) == 1)) || image.size(-3) != 3 ||
        image.numel() == 0 || !(image.scalar_type() == torch::kFloat || image.scalar_type() == torch::kDouble))
        throw std::invalid_argument(
            fmt::format("augment: the image must be 1×3×S×S in float32 or float64, not [{}]",
                        image.defined() ? fmt::format("{}", fmt::join(image.sizes(), ", ")) : ""));
    if (fill.numel() != 3)
        throw std::invalid_argument(fmt::format("augment: fill has {} values, must be 3", fill.numel()));
    if (augmentations.empty()) throw std::invalid_argument("augment: no augmentations");
    const Tensor whole = image.dim() == 3 ? image.unsqueeze(0) : image;
    const Tensor outside = fill.detach().to(whole.device(), whole.scalar_type()).view({1, 3, 1, 1});

    // The neutral first copy goes round the arithmetic: it is the picture, bit for bit.
    const bool exact_first = augmentations[0] == Augmentation{};
    const std::vector<Augmentation> rest(augmentations.begin() + (exact_first ? 1 : 0), augmentations.end());
    if (rest.empty()) return whole.clone();
    Tensor x = colour(whole, rest) - outside;
    x = shift(x, rest);
    x = warp(x * cutout_mask(x, rest), rest) + outside;
    return exact_first ? at::cat({whole, x}) : x;
}

}  // namespace fieldgraft
