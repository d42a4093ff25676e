#include "vdb_export/sampling.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>

#include "core/base/errors.h"
#include "vdb_export/content_edge.h"

namespace fieldgraft {
namespace {

// A soft ball (σ = 3 (1 − r²/r₀²) around `centre`) with a colour that depends on the place.
struct Ball {
    Tensor centre = torch::tensor({0.2f, -0.1f, 0.3f});
    double radius = 0.6;
    Tensor density(const Tensor& x) const {
        return 3 * (1 - (x - centre).square().sum(1) / (radius * radius)).clamp_min(0);
    }
    static Tensor color(const Tensor& x) { return at::sigmoid(2 * x); }
    VolumeSource medium() const {
        return {[*this](const Tensor& x) { return density(x); }, [](const Tensor& x) { return color(x); }, {}};
    }
};

FieldGeometry box(double edge) {
    FieldGeometry geometry;
    geometry.box_min = {-edge, -edge, -edge};
    geometry.box_max = {edge, edge, edge};
    return geometry;
}

// Model positions of all voxels of the kept blocks, B·512×3, by an independent route: the world transform and the
// frame.
Tensor model_positions(const SparseVolume& volume, const FieldGeometry& geometry) {
    const std::int64_t blocks = volume.origins.size(0);
    Tensor positions = at::empty({blocks * block_voxels, 3}, at::kFloat);
    float* out = positions.data_ptr<float>();
    for (std::int64_t b = 0; b < blocks; ++b) {
        const int* origin = volume.origins.data_ptr<int>() + 3 * b;
        for (int v = 0; v < block_voxels; ++v, out += 3) {
            const double index[3] = {origin[0] + v / 64.0 - v % 64 / 64.0, origin[1] + (v / 8) % 8 * 1.0,
                                     origin[2] + v % 8 * 1.0};
            double world[3];
            for (int r = 0; r < 3; ++r) {
                const double* m = volume.index_to_world.data() + 4 * r;
                world[r] = m[0] * index[0] + m[1] * index[1] + m[2] * index[2] + m[3];
            }
            for (int r = 0; r < 3; ++r) {
                const double* f = geometry.frame.data() + 4 * r;
                out[r] = static_cast<float>(f[0] * world[0] + f[1] * world[1] + f[2] * world[2] + f[3]);
            }
        }
    }
    return positions;
}

double largest(const Tensor& difference) {
    return difference.abs().max().item<double>();
}

TEST(Sampling, VoxelsHoldTheMediumAtTheirCentres) {
    const FieldGeometry geometry = box(1);
    const Ball ball;
    const SparseVolume volume =
        sample_volume(geometry, ball.medium(), {.voxel = 2.0 / 50, .threshold = 0, .supersample = 1});
    const Tensor positions = model_positions(volume, geometry);
    EXPECT_LT(largest(volume.density.view({-1}) - ball.density(positions)), 2e-5);
    const Tensor active = volume.density.view({-1}) > 0;
    EXPECT_LT(largest((volume.color.view({-1, 3}) - Ball::color(positions)) * active.unsqueeze(1)), 1e-5);
    // Everything the ball fills is there: its volume in voxels.
    const double expected = 4.0 / 3.0 * M_PI * std::pow(ball.radius / 0.04, 3);
    EXPECT_NEAR(active.sum().item<double>(), expected, 0.02 * expected);
}

// A world that is turned, scaled and shifted against the model: places match, and optical depth is kept.
TEST(Sampling, WorldTransformInvertsTheFrame) {
    FieldGeometry geometry = box(1);
    const double c = std::cos(0.7), s = std::sin(0.7), scale = 0.25;
    geometry.frame = {scale * c, -scale * s, 0, 0.4, scale * s, scale * c, 0, -0.2, 0, 0, scale, 0.1};
    const Ball ball;
    const SparseVolume volume =
        sample_volume(geometry, ball.medium(), {.voxel = 2.0 / 40, .threshold = 0, .supersample = 1});
    EXPECT_LT(largest(volume.density.view({-1}) - scale * ball.density(model_positions(volume, geometry))), 2e-5);
    const auto& m = volume.index_to_world;
    EXPECT_NEAR(std::hypot(m[0], m[4], m[8]), 2.0 / 40 / scale, 1e-9);  // the voxel's edge in the world
    geometry.frame[0] *= 1.1;
    EXPECT_THROW(sample_volume(geometry, ball.medium(), {.voxel = 0.1}), std::invalid_argument);
}

TEST(Sampling, EmptyCellsAreNotLookedAt) {
    const FieldGeometry geometry = box(1);
    Ball ball;
    Tensor occupancy = at::zeros({4, 4, 4}, at::kByte);
    occupancy[2][1][3] = 1;  // z, y, x: x in [0.5, 1), y in [−0.5, 0), z in [0, 0.5)
    VolumeSource medium = ball.medium();
    std::int64_t asked = 0;
    medium.density = [&](const Tensor& x) {
        asked += x.size(0);
        EXPECT_GE(x.amin(0)[0].item<float>(), 0.5f);
        EXPECT_LE(x.amax(0)[2].item<float>(), 0.5f);
        return at::ones({x.size(0)}, at::kFloat);
    };
    medium.occupancy = {occupancy};
    const SparseVolume volume = sample_volume(geometry, medium, {.voxel = 2.0 / 64, .supersample = 1});
    EXPECT_EQ(volume.origins.size(0), 8);  // 16 voxels an edge: 2×2×2 blocks
    EXPECT_EQ(asked, 2 * 8 * block_voxels);
    EXPECT_EQ(volume.origins.amin(0)[0].item<int>(), 48);
    EXPECT_EQ(volume.origins.amin(0)[1].item<int>(), 16);
    EXPECT_EQ(volume.origins.amin(0)[2].item<int>(), 32);
    // A second grid adds its cells.
    medium.density = [](const Tensor& x) { return at::ones({x.size(0)}, at::kFloat); };
    Tensor other = at::zeros({2, 2, 2}, at::kByte);
    other[0][0][0] = 1;
    medium.occupancy.push_back(other);
    EXPECT_EQ(sample_volume(geometry, medium, {.voxel = 2.0 / 64}).origins.size(0), 8 + 64);
}

// An opaque half space cut by the grid: densities are coverage times the cap, whatever the field's own height.
TEST(Sampling, HardSurfacesAreAntiAliased) {
    const FieldGeometry geometry = box(1);
    const double h = 2.0 / 16;
    VolumeSource medium{
        [&](const Tensor& x) { return at::where(x.select(1, 0) < -1 + 5.25 * h, 1e6, 0.0).to(at::kFloat); },
        [](const Tensor& x) {
            return at::full({x.size(0), 3}, 0.5f);
        },
        {}};
    const SparseVolume volume = sample_volume(geometry, medium, {.voxel = h, .max_optical_depth = 4, .supersample = 4});
    for (std::int64_t b = 0; b < volume.origins.size(0); ++b) {
        ASSERT_EQ(volume.origins[b][0].item<int>(), 0);
        for (int x = 0; x < 8; ++x) {
            const double coverage = x < 5 ? 1 : x == 5 ? 0.25 : 0;
            EXPECT_NEAR(volume.density[b][64 * x + 9].item<double>() * h, 4 * coverage, 1e-4) << x;
        }
    }
}

TEST(Sampling, FaintVoxelsAndEmptyBlocksAreDropped) {
    const FieldGeometry geometry = box(1);
    const double h = 2.0 / 32;
    VolumeSource medium{
        [&](const Tensor& x) { return at::where(x.select(1, 2) < 0, 0.02 / h, 0.005 / h).to(at::kFloat); },
        [](const Tensor& x) {
            return at::full({x.size(0), 3}, 0.5f);
        },
        {}};
    const SparseVolume volume = sample_volume(geometry, medium, {.voxel = h, .threshold = 0.01});
    EXPECT_EQ(volume.origins.size(0), 4 * 4 * 2);
    EXPECT_LT(volume.origins.amax(0)[2].item<int>(), 16);
    EXPECT_EQ(sample_volume(geometry, medium, {.voxel = h, .threshold = 0.05}).origins.size(0), 0);
}

// A box whose edges are no multiple of the voxel or of 8: nothing outside, chunks do not matter.
TEST(Sampling, OddSizesAndChunks) {
    FieldGeometry geometry = box(1);
    geometry.box_max = {0.9, 0.35, 1.0};
    VolumeSource medium{[](const Tensor& x) { return at::ones({x.size(0)}, at::kFloat) * 2; },
                        [](const Tensor& x) { return at::sigmoid(x); },
                        {}};
    const double h = 0.11;
    const auto counts = voxel_counts(geometry, h);
    EXPECT_EQ(counts, (std::array<std::int64_t, 3>{18, 13, 19}));
    const SparseVolume whole = sample_volume(geometry, medium, {.voxel = h, .supersample = 1});
    // Voxels whose centres lie in the box: the last of an axis may have its centre outside.
    EXPECT_EQ((whole.density > 0).sum().item<std::int64_t>(), 17 * 12 * 18);
    const SparseVolume chunked =
        sample_volume(geometry, medium, {.voxel = h, .supersample = 1, .chunk_positions = 700});
    EXPECT_TRUE(whole.origins.equal(chunked.origins));
    EXPECT_TRUE(whole.density.equal(chunked.density));
    EXPECT_LT(largest(whole.color - chunked.color), 1e-6);
}

TEST(Sampling, ReportsProgressAndStops) {
    const FieldGeometry geometry = box(1);
    std::atomic<bool> stop = false;
    std::int64_t last = 0, total = 0;
    const Reporter reporter(
        [&](const Json& event) {
            last = event.at("iteration"), total = event.at("total");
            if (last >= 64) stop = true;
        },
        &stop);
    const SamplingOptions options{.voxel = 2.0 / 64, .supersample = 1, .chunk_positions = 16 * block_voxels};
    EXPECT_THROW(sample_volume(geometry, Ball().medium(), options, reporter), Cancelled);
    EXPECT_EQ(last, 64);
    EXPECT_EQ(total, 512);
}

TEST(Sampling, BadOptionsAreNamed) {
    const VolumeSource medium = Ball().medium();
    EXPECT_THROW(sample_volume(box(1), medium, {.voxel = 0}), std::invalid_argument);
    EXPECT_THROW(sample_volume(box(1), medium, {.voxel = 0.1, .threshold = -1}), std::invalid_argument);
    EXPECT_THROW(sample_volume(box(1), medium, {.voxel = 0.1, .supersample = 0}), std::invalid_argument);
    VolumeSource wrong = medium;
    wrong.occupancy = {at::zeros({4, 4, 2}, at::kByte)};
    EXPECT_THROW(sample_volume(box(1), wrong, {.voxel = 0.1}), std::invalid_argument);
}

TEST(ContentEdge, IsTheThingsLengthWhateverTheBox) {
    const Ball ball;
    VolumeSource dense = ball.medium();
    dense.density = [ball](const Tensor& x) { return 100 * ball.density(x); };
    for (const double edge : {1.0, 4.0}) {
        const double found = content_edge(box(edge), dense, {});
        // Up to two of the coarse voxels more, and less what the thousandth at either end of a ball takes.
        EXPECT_LT(found, 2 * ball.radius + 2 * (2 * edge / 128)) << edge;
        EXPECT_GT(found, 0.9 * 2 * ball.radius) << edge;
    }
}

TEST(ContentEdge, TakesTheLongestAxisAndIgnoresAFloater) {
    VolumeSource bar{[](const Tensor& x) {
                         const Tensor size = torch::tensor({0.1f, 0.8f, 0.2f});
                         return 50 * (x.abs() < size).all(1).to(at::kFloat);
                     },
                     Ball::color,
                     {}};
    const double alone = content_edge(box(2), bar, {});
    EXPECT_NEAR(alone, 1.6, 2 * 4.0 / 128);
    VolumeSource with_floater = bar;
    with_floater.density = [bar](const Tensor& x) {
        const Tensor far = (x - torch::tensor({1.9f, -1.9f, 1.9f})).abs().amax(1) < 0.02;
        return bar.density(x) + 50 * far.to(at::kFloat);
    };
    EXPECT_EQ(content_edge(box(2), with_floater, {}), alone);
    VolumeSource nothing{[](const Tensor& x) { return at::zeros({x.size(0)}, at::kFloat); }, Ball::color, {}};
    EXPECT_EQ(content_edge(box(2), nothing, {}), 4);
}

}  // namespace
}  // namespace fieldgraft
