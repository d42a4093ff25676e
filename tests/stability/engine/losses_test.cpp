// The losses against 50 digits: entropy, region, opacity, cosines. All of them are libtorch operations in float32.
#include "core/edit/losses.h"

#include <gtest/gtest.h>

#include "core/base/errors.h"
#include "core/base/random.h"
#include "core/guidance/clip_losses.h"
#include "tests/stability/big.h"
#include "tests/stability/ledger.h"

namespace fieldgraft::stability {
namespace {

using Bigs = std::vector<Big>;
constexpr const char* path = "torch";

Big log2_of(const Big& x) {
    return boost::multiprecision::log(x) / boost::multiprecision::log(Big(2));
}
Big square(const Big& x) {
    return x * x;
}
Big size_of(const Big& x) {
    return boost::multiprecision::abs(x);
}

std::pair<float, std::vector<float>> value_and_gradient(const std::function<Tensor(const Tensor&)>& loss,
                                                        const Tensor& at) {
    const Tensor x = at.clone().requires_grad_(true), value = loss(x);
    const Tensor gradient = torch::autograd::grad({value}, {x}, {}, std::nullopt, false, true)[0];
    std::vector<float> slopes(static_cast<std::size_t>(at.numel()), 0.0f);
    if (gradient.defined()) {
        const Tensor flat = gradient.contiguous().view(-1);
        slopes.assign(flat.const_data_ptr<float>(), flat.const_data_ptr<float>() + flat.numel());
    }
    return {value.item<float>(), slopes};
}

TEST(Entropy, ValueAndGradient) {
    std::vector<float> values{0,     1,       1e-45f, 1e-40f, 1e-38f,       1e-20f,      0x1p-20f,
                              0.25f, 0.4999f, 0.5f,   0.75f,  1 - 0x1p-20f, 1 - 0x1p-24f};
    for (float z = 1e-37f; z < 1; z *= 2.3f) values.push_back(z);
    for (float d = 0x1p-24f; d < 0.5f; d *= 2.3f) values.push_back(1 - d);
    for (const float z : values) {
        const std::string input = z == 0 || z == 1             ? "z = 0, 1"
                                  : z < 1e-6f || z > 1 - 1e-6f ? "z a hair from 0, 1"
                                                               : "0 < z < 1";
        const auto [value, slopes] = value_and_gradient(binary_entropy, at::full({1}, z));
        const Big p = z;
        const Big right = z == 0 || z == 1 ? Big(0) : Big(-p * log2_of(p) - (1 - p) * log2_of(1 - p));
        const float naive = -z * std::log2(z) - (1 - z) * std::log2(1 - z);
        ledger().add("entropy H", "value", path, input, error_of(value, right, right, 4 * smallest),
                     error_of(naive, right, right, 4 * smallest));
        // The slope is held beyond 2⁻²⁰, as promised.
        const Big held = std::clamp(z, 0x1p-20f, 1 - 0x1p-20f), a = log2_of(held), b = log2_of(1 - held);
        ledger().add("entropy H", "gradient", path, input, error_of(slopes[0], b - a, size_of(a) + size_of(b)),
                     error_of(std::log2((1 - z) / z), b - a, size_of(a) + size_of(b)));
    }
}

struct MaskCase {
    std::string input;
    Tensor positive, negative;
};

std::vector<MaskCase> mask_cases(int size) {
    const Tensor none = at::zeros({size, size}, at::kBool), all = at::ones({size, size}, at::kBool);
    Tensor pixel = none.clone(), half = none.clone();
    pixel[size / 2][size / 3].fill_(true);
    half.slice(0, 0, size / 2).fill_(true);
    return {{"empty mask", none, all},
            {"full mask", all, none},
            {"one pixel", pixel, pixel.logical_not()},
            {"half the picture", half, half.logical_not()},
            {"masks that leave a gap", pixel, half.logical_and(pixel.logical_not())}};
}

Bigs numbers(const Tensor& tensor) {
    Bigs out;
    const Tensor flat = tensor.contiguous().view(-1).to(at::kDouble);
    for (std::int64_t i = 0; i < flat.numel(); ++i) out.emplace_back(flat[i].item<double>());
    return out;
}

TEST(RegionLoss, ValueAndGradient) {
    const int size = 24;
    Random random(4);
    Tensor map = at::empty({size, size});
    for (std::int64_t i = 0; i < map.numel(); ++i) map.view(-1)[i].fill_(random.uniform());
    for (const float level : {0.0f, 1e-20f, 1.0f, -1.0f}) {  // −1: the random map
        const Tensor at_map = level < 0 ? map : at::full({size, size}, level);
        for (const MaskCase& c : mask_cases(size)) {
            const double pixels = size * size, weight = positive_weight(c.positive.sum().item<double>(), pixels, 30);
            const auto [value, slopes] = value_and_gradient(
                [&](const Tensor& x) {
                    return region_loss(x, {c.positive, c.negative}, weight);
                },
                at_map);
            const Bigs e = numbers(at_map), in = numbers(c.positive), out = numbers(c.negative);
            Big right = 0;
            for (std::size_t i = 0; i < e.size(); ++i)
                right += (out[i] * square(e[i]) + weight * in[i] * square(1 - e[i])) / pixels;
            ledger().add("L_region", "value", path, c.input, error_of(value, right, right, smallest));
            for (std::size_t i = 0; i < e.size(); ++i) {
                const Big slope = 2 * (out[i] * e[i] - weight * in[i] * (1 - e[i])) / pixels;
                ledger().add("L_region", "gradient", path, c.input,
                             error_of(slopes[i], slope, size_of(slope), smallest));
            }
        }
    }
}

TEST(OpacityLoss, ValueAndGradient) {
    const int size = 24;
    for (const auto& [input, level, tau] : {std::tuple{"below τ", 0.1f, 0.2},
                                            {"above τ", 0.6f, 0.2},
                                            {"nothing", 0.0f, 0.05},
                                            {"everything", 1.0f, 0.35}}) {
        const auto [value, slopes] =
            value_and_gradient([&](const Tensor& x) { return opacity_loss(x, tau); }, at::full({size, size}, level));
        const bool over = level > tau;
        const Big right = over ? Big(level) : Big(tau), slope = over ? 1 / Big(size * size) : Big(0);
        ledger().add("L_opacity", "value", path, input, error_of(value, right, right));
        for (const float s : slopes)
            ledger().add("L_opacity", "gradient", path, input, error_of(s, slope, Big(1) / (size * size)));
    }
}

// Losses between embeddings in 50 digits, with their gradients by the embedding that is learnt (differences with steps
// far below what float32 sees, far above what 50 digits do).
Big dot(const Bigs& a, const Bigs& b) {
    Big sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
    return sum;
}
Bigs scaled(Bigs v, const Big& by) {
    for (Big& x : v) x *= by;
    return v;
}
Bigs unit(const Bigs& v) {
    return scaled(v, 1 / boost::multiprecision::sqrt(dot(v, v) + Big("1e-24")));
}
Bigs minus(Bigs a, const Bigs& b) {
    for (std::size_t i = 0; i < a.size(); ++i) a[i] -= b[i];
    return a;
}
Big global_of(const Bigs& image, const Bigs& text) {
    return 1 - dot(unit(image), unit(text));
}
Big directional_of(const Bigs& before, const Bigs& after, const Bigs& source, const Bigs& target) {
    const Bigs moved = minus(unit(after), unit(before)), said = minus(unit(target), unit(source));
    const Big epsilon = Big(difference_epsilon);
    return 1 -
           dot(moved, said) / boost::multiprecision::sqrt((dot(moved, moved) + epsilon * epsilon) * dot(said, said));
}
Bigs slopes_of(const std::function<Big(const Bigs&)>& f, Bigs at) {
    const Big h = Big("1e-20") * boost::multiprecision::sqrt(dot(at, at));
    Bigs out;
    for (Big& x : at) {
        const Big kept = x;
        x = kept + h;
        const Big up = f(at);
        x = kept - h;
        out.push_back((up - f(at)) / (2 * h));
        x = kept;
    }
    return out;
}

Tensor normals(Random& random, std::int64_t size) {
    Tensor out = at::empty({size});
    for (std::int64_t i = 0; i < size; ++i) out[i].fill_(random.normal());
    return out;
}

struct EmbeddingCase {
    std::string input;
    Tensor before, after;
};

std::vector<EmbeddingCase> embedding_cases() {
    Random random(9);
    const std::int64_t size = 64;
    const Tensor before = normals(random, size), other = normals(random, size);
    std::vector<EmbeddingCase> cases{{"first iteration: Iᵝ = Iᵒ", before, before},
                                     {"opposite", before, -before},
                                     {"ordinary", before, other},
                                     {"long embeddings, × 1e4", before * 1e4, other * 1e4},
                                     {"short embeddings, × 1e-4", before * 1e-4, other * 1e-4}};
    for (const double move : {1e-7, 1e-5, 1e-3})
        cases.push_back({"hardly moved: 1e-7 … 1e-3", before, before + move * other});
    return cases;
}

// What 1 − cos(a, b) is with plain norms, in float32.
float plain_cosine_loss(const Tensor& a, const Tensor& b) {
    return 1 - ((a * b).sum() / (a.norm() * b.norm())).item<float>();
}

void check_embedding(const std::string& quantity, const std::string& input, const Tensor& at,
                     const std::function<Tensor(const Tensor&)>& loss, const std::function<Big(const Bigs&)>& right,
                     const std::function<float()>& naive) {
    const auto [value, slopes] = value_and_gradient(loss, at.unsqueeze(0));
    ledger().add(quantity, "value", path, input, error_of(value, right(numbers(at)), 1),
                 error_of(naive(), right(numbers(at)), 1));
    const Bigs slope = slopes_of(right, numbers(at));
    // The loss turns with the embedding's direction: its slope is at most 1/ε over the length.
    const Big longest = boost::multiprecision::sqrt(dot(slope, slope));
    for (std::size_t i = 0; i < slope.size(); ++i)
        ledger().add(quantity, "gradient", path, input, error_of(slopes[i], slope[i], longest));
}

TEST(Cosines, ValueAndGradient) {
    Random random(21);
    const Tensor source = normals(random, 64), target = normals(random, 64);
    for (const EmbeddingCase& c : embedding_cases()) {
        check_embedding(
            "L_global", c.input, c.after, [&](const Tensor& x) { return global_loss(x, target); },
            [&](const Bigs& x) { return global_of(x, numbers(target)); },
            [&] { return plain_cosine_loss(c.after, target); });
        check_embedding(
            "L_dir", c.input, c.after,
            [&](const Tensor& x) { return directional_loss(c.before.unsqueeze(0), x, source, target); },
            [&](const Bigs& x) { return directional_of(numbers(c.before), x, numbers(source), numbers(target)); },
            [&] {
                return plain_cosine_loss(c.after / c.after.norm() - c.before / c.before.norm(),
                                         target / target.norm() - source / source.norm());
            });
    }
}

TEST(Cosines, PromptsThatEmbedAlikeAreAnError) {
    Random random(2);
    const Tensor image = normals(random, 16).unsqueeze(0), text = normals(random, 16);
    EXPECT_THROW(directional_loss(image, image, text, text), InputError);
    EXPECT_THROW(directional_loss(image, image, text, 3 * text), InputError);
    EXPECT_NO_THROW(directional_loss(image, image, text, -text));
}

// One-sided derivatives at the kinks of the losses (docs/stability.md lists them).
TEST(Kinks, GradientsAreOneOfTheOneSidedDerivatives) {
    // max(τ, mean E) at mean E = τ: 0 from below, 1/S² from above; ours is one of the two.
    const auto [value, slopes] =
        value_and_gradient([](const Tensor& x) { return opacity_loss(x, 0.5); }, at::full({2, 2}, 0.5));
    EXPECT_EQ(value, 0.5f);
    EXPECT_TRUE(slopes[0] == 0 || slopes[0] == 0.25f) << slopes[0];
    // H at 0 and 1: the slope is infinite; ours is held at ±log₂(2²⁰ − 1).
    EXPECT_NEAR(value_and_gradient(binary_entropy, at::zeros({1})).second[0], 20, 1e-4);
    EXPECT_NEAR(value_and_gradient(binary_entropy, at::ones({1})).second[0], -20, 1e-4);
}

}  // namespace
}  // namespace fieldgraft::stability
