// The vote grid: cells, trilinear look-up, majority of views, filling what no view sees.
#include "core/edit/vote_grid.h"

#include <gtest/gtest.h>

namespace fieldgraft {
namespace {

FieldGeometry box() {
    FieldGeometry geometry;
    geometry.box_min = {-1, -2, 0};
    geometry.box_max = {1, 2, 8};
    return geometry;
}

TEST(VoteGrid, CellsAreZYXOverTheBox) {
    const Tensor points =
        at::tensor({-0.9f, -1.9f, 0.1f, 0.9f, -1.9f, 0.1f, 0.9f, 1.9f, 7.9f, 1.1f, 0.0f, 1.0f}).reshape({4, 3});
    const Tensor cells = cell_of(box(), 4, points);
    EXPECT_TRUE(at::equal(cells, at::tensor({0, 3, 63, -1}, at::kLong)));
    const Tensor centres = cell_centres(box(), 4);
    EXPECT_TRUE(at::equal(cell_of(box(), 4, centres), at::arange(64)));
}

TEST(VoteGrid, TrilinearLookUpIsExactForALinearFunction) {
    const Tensor centres = cell_centres(box(), 8);
    const Tensor weights = at::tensor({0.5f, -0.25f, 0.125f});
    const Tensor grid = (centres.matmul(weights) + 1).reshape({8, 8, 8});
    const Tensor points = at::tensor({0.3f, -0.7f, 3.3f, -0.6f, 1.2f, 6.1f}).reshape({2, 3});
    EXPECT_LT((sample_grid(grid, box(), points) - points.matmul(weights) - 1).abs().max().item<float>(), 1e-5f);
    EXPECT_EQ(sample_grid(grid, box(), at::full({1, 3}, 20.0f)).item<float>(), 0.0f);
    EXPECT_EQ(sample_grid(grid, box(), at::zeros({0, 3})).numel(), 0);
}

TEST(VoteGrid, ViewsOutvoteOneAnother) {
    VoteGrid votes(box(), 4);
    const Tensor point = at::zeros({1, 3}) + at::tensor({0.1f, 0.1f, 0.1f});
    for (int view = 0; view < 5; ++view)
        votes.add(point, at::full({1}, view < 4 ? 1.0f : 0.0f), at::full({1}, 0.5f), at::ones({1, 3}));
    EXPECT_NEAR(votes.score(0).max().item<float>(), 0.8f, 1e-6);
    EXPECT_NEAR(votes.weight().sum().item<float>(), 2.5f, 1e-6);
    EXPECT_THROW(votes.add(point, at::ones({2}), at::ones({2}), at::ones({1, 3})), std::invalid_argument);
    EXPECT_THROW(votes.add(point, at::ones({1}), at::ones({1}), at::ones({1})), std::invalid_argument);
}

TEST(VoteGrid, UnseenCellsTakeTheirNeighboursScores) {
    VoteGrid votes(box(), 8);
    const Tensor centres = cell_centres(box(), 8);
    const Tensor seen = centres.select(1, 2) < 1;  // the lowest layer
    votes.add(centres.index({seen}), (centres.index({seen}).select(1, 0) > 0).to(at::kFloat), at::ones({64}),
              at::ones({64, 3}));
    EXPECT_EQ(votes.score(0).slice(0, 1).sum().item<float>(), 0.0f);
    const Tensor reached = votes.score(2);
    EXPECT_GT(reached[2][4][6].item<float>(), 0.9f);
    EXPECT_LT(reached[2][4][1].item<float>(), 0.1f);
    EXPECT_EQ(reached[3].sum().item<float>(), 0.0f);
    EXPECT_LE(reached.max().item<float>(), 1.0f);
}

// A tan plate, votes 1, and a black block on it, votes 0; the block's lowest layer is mistaken for the plate.
TEST(VoteGrid, CellsOfLikeColourAgree) {
    const Tensor centres = cell_centres(box(), 12);
    const Tensor layer = cell_of(box(), 12, centres).floor_divide(144);
    const Tensor plate = layer < 2, block = layer.greater_equal(2).logical_and(layer < 8);
    const Tensor seen = plate.logical_or(block);
    const Tensor voted = (layer < 3).to(at::kFloat);
    const Tensor colours = plate.to(at::kFloat).unsqueeze(1) * at::tensor({0.8f, 0.7f, 0.5f});
    VoteGrid votes(box(), 12), flat(box(), 12);
    votes.add(centres.index({seen}), voted.index({seen}), at::ones({8 * 144}), colours.index({seen}));
    votes.agree_by_colour(0.1, 24);
    const Tensor score = votes.score(0);
    EXPECT_GT(score.slice(0, 0, 2).min().item<float>(), 0.999f);
    EXPECT_LT(score[2].max().item<float>(), 0.6f);  // was 1
    EXPECT_LT(score.slice(0, 4, 8).max().item<float>(), 0.3f);
    EXPECT_EQ(score.slice(0, 8).abs().max().item<float>(), 0.0f);
    EXPECT_NEAR(votes.weight().sum().item<float>(), 8 * 144, 1e-2);
    // Of one colour, the same votes are only smoothed: they stay within what was voted, highest where it was.
    flat.add(centres.index({seen}), voted.index({seen}), at::ones({8 * 144}), at::zeros({8 * 144, 3}));
    flat.agree_by_colour(0.1, 24);
    EXPECT_GT(flat.score(0)[2].min().item<float>(), flat.score(0)[3].max().item<float>());
    EXPECT_LE(flat.score(0).max().item<float>(), 1.0f);
    // Nothing to agree on, nobody to agree with.
    VoteGrid(box(), 4).agree_by_colour(0.1, 3);
    VoteGrid lone(box(), 4);
    lone.add(at::zeros({1, 3}) + 0.1, at::full({1}, 0.7f), at::ones({1}), at::zeros({1, 3}));
    lone.agree_by_colour(0.1, 3);
    EXPECT_NEAR(lone.score(0).max().item<float>(), 0.7f, 1e-6);
}

// A yellow bar whose left end is marked, on a grey floor; every cell is allowed but the bar's right end.
TEST(VoteGrid, GrowsThroughOneColourWhereItIsAllowed) {
    const int n = 12;
    const Tensor centres = cell_centres(box(), n);
    const Tensor cell = cell_of(box(), n, centres);
    const Tensor x = cell.remainder(n), y = cell.floor_divide(n).remainder(n), z = cell.floor_divide(n * n);
    const Tensor bar = (y == 6).logical_and(z == 1), floor = z == 0;
    const Tensor seen = bar.logical_or(floor);
    const Tensor yellow = at::tensor({0.9f, 0.7f, 0.1f}), grey = at::tensor({0.5f, 0.5f, 0.5f});
    // From left to right the bar darkens, by less than a step from cell to cell.
    const Tensor shade = (1 - 0.05 * x.to(at::kFloat)).unsqueeze(1);
    const Tensor colours = at::where(bar.unsqueeze(1), yellow * shade, grey);
    VoteGrid votes(box(), n);
    votes.add(centres.index({seen}), at::zeros({n * n + n}), at::ones({n * n + n}), colours.index({seen}));
    const auto cube = [&](const Tensor& flat) { return flat.reshape({n, n, n}); };
    const Tensor marked = cube(bar.logical_and(x < 2)), allowed = cube(x < 9);
    const Tensor grown = votes.grown_by_colour(marked, allowed, 0.1);
    EXPECT_TRUE(at::equal(grown, cube(bar.logical_and(x < 9))));
    EXPECT_TRUE(at::equal(votes.grown_by_colour(marked, allowed, 0.01), marked));  // finer than the shading's steps
    EXPECT_TRUE(at::equal(votes.grown_by_colour(marked, at::zeros_like(allowed), 0.1), marked));
    EXPECT_TRUE(at::equal(VoteGrid(box(), n).grown_by_colour(marked, allowed, 0.1), marked));  // nothing was seen
    EXPECT_THROW(votes.grown_by_colour(marked, at::ones({2, 2, 2}), 0.1), std::invalid_argument);
}

TEST(VoteGrid, TheBorderFollowsTheCore) {
    // A core that all views agree on, something that 60 % take for it, and the rest.
    Tensor score = at::zeros({4, 4, 4});
    score[0].fill_(1.0);
    score[1].fill_(0.6);
    score[2].fill_(0.3);
    const Tensor sure = scaled_to_border(score, 0.7) > 0.5;
    EXPECT_TRUE(sure[0].all().item<bool>());
    EXPECT_FALSE(sure[1].any().item<bool>());
    // A region that no view is sure of keeps what half of the votes give it.
    const Tensor doubtful = (score * 0.55 / 0.6).clamp_max(0.55);
    EXPECT_TRUE((scaled_to_border(doubtful, 0.7) > 0.5)[1].all().item<bool>());
    // One that no view is even half sure of ends at the least vote that counts, and there is none below that.
    const Tensor faint = scaled_to_border(score * 0.45, 0.7) > 0.5;
    EXPECT_TRUE(faint[0].all().item<bool>());
    EXPECT_FALSE(faint[1].any().item<bool>());
    EXPECT_TRUE(at::equal(scaled_to_border(score * 0.28, 0.7), score * 0.28));
    EXPECT_LE(scaled_to_border(score, 0.2).max().item<float>(), 1.0f);
}

}  // namespace
}  // namespace fieldgraft
