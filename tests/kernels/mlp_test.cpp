#include "core/kernels/mlp_ref.h"

#include <gtest/gtest.h>

#include "tests/kernels/numeric.h"

namespace fieldgraft {
namespace {

using testing::random_values;
using Spans = std::vector<std::span<const double>>;

struct Net {
    MlpShape shape{{3, 5, 4, 2}};
    std::vector<std::vector<double>> weights;
    Net() {
        for (std::size_t i = 0; i + 1 < shape.widths.size(); ++i) {
            weights.push_back(random_values<double>(shape.widths[i] * shape.widths[i + 1], 20 + i));
        }
    }
    Spans spans() const { return Spans(weights.begin(), weights.end()); }
    std::vector<double> forward(const std::vector<double>& input) const {
        std::vector<std::vector<double>> activations;
        mlp_forward<double>(shape, spans(), input, activations);
        return activations.back();
    }
};

TEST(Mlp, OneSampleByHand) {
    const MlpShape shape{{2, 2, 1}};
    const std::vector<double> w0{1, 2, -3, 1}, w1{2, 5}, x{1, 1};  // hidden: 3, −2 → 0
    std::vector<std::vector<double>> activations;
    mlp_forward<double>(shape, {w0, w1}, x, activations);
    EXPECT_DOUBLE_EQ(activations[0][0], 3);
    EXPECT_DOUBLE_EQ(activations[0][1], 0);
    EXPECT_DOUBLE_EQ(activations[1][0], 6);
}

TEST(Mlp, SamplesDoNotMix) {
    const Net net;
    const auto batch = random_values<double>(3 * 7, 1);
    const auto all = net.forward(batch);
    for (int s = 0; s < 7; ++s) {
        const auto one = net.forward({batch[s], batch[7 + s], batch[14 + s]});
        EXPECT_DOUBLE_EQ(one[0], all[s]);
        EXPECT_DOUBLE_EQ(one[1], all[7 + s]);
    }
}

TEST(Mlp, BackwardEqualsFiniteDifferences) {
    for (const std::size_t n : {1u, 6u}) {
        Net net;
        auto input = random_values<double>(3 * n, 2);
        const auto out_grad = random_values<double>(2 * n, 3);
        std::vector<std::vector<double>> activations, grads;
        mlp_forward<double>(net.shape, net.spans(), input, activations);
        for (const auto& w : net.weights) grads.emplace_back(w.size(), 0.0);
        std::vector<double> input_grad(input.size());
        mlp_backward<double>(net.shape, net.spans(), input, activations, out_grad,
                             std::vector<std::span<double>>(grads.begin(), grads.end()), input_grad);
        const auto loss = [&] { return testing::dot(net.forward(input), out_grad); };
        for (std::size_t i = 0; i < input.size(); ++i)
            ASSERT_NEAR(input_grad[i], testing::slope(input[i], 1e-6, loss), 1e-7);
        for (std::size_t l = 0; l < grads.size(); ++l) {
            for (std::size_t i = 0; i < grads[l].size(); ++i) {
                ASSERT_NEAR(grads[l][i], testing::slope(net.weights[l][i], 1e-6, loss), 1e-7) << l << ' ' << i;
            }
        }
    }
}

TEST(Mlp, NoSamplesAndWrongSizes) {
    const Net net;
    EXPECT_TRUE(net.forward({}).empty());
    std::vector<std::vector<double>> activations;
    EXPECT_THROW(mlp_forward<double>(net.shape, net.spans(), std::vector<double>(4), activations),
                 std::invalid_argument);
    EXPECT_THROW(mlp_forward<double>({{3, 5}}, net.spans(), std::vector<double>(3), activations),
                 std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
