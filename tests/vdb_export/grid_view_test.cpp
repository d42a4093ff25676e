#include "vdb_export/grid_view.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>

#include "core/base/errors.h"
#include "vdb_export/sampling.h"
#include "vdb_export/sparse_volume.h"

namespace fieldgraft {
namespace {

std::filesystem::path scratch(const std::string& name) {
    const auto folder = std::filesystem::temp_directory_path() / fmt::format("fieldgraft_grid_view_{}", getpid());
    std::filesystem::create_directories(folder);
    return folder / name;
}

// A turned, scaled, mirrored and shifted world.
FieldGeometry turned_geometry() {
    FieldGeometry geometry;
    const double c = std::cos(0.4), s = std::sin(0.4), scale = 0.5;
    geometry.frame = {scale * c, -scale * s, 0, 0.4, scale * s, scale * c, 0, -0.2, 0, 0, -scale, 0.1};
    return geometry;
}

constexpr double half_side = 0.6;

// A cube of even density (per model unit) and colour about the origin, sampled as bake() would.
std::filesystem::path cube(const FieldGeometry& geometry, double density, double voxel) {
    VolumeSource source;
    source.density = [=](const Tensor& p) { return density * (p.abs().amax(1) < half_side).to(at::kFloat); };
    source.color = [](const Tensor& p) { return torch::tensor({0.8f, 0.4f, 0.2f}).expand({p.size(0), 3}).clone(); };
    SamplingOptions options;
    options.voxel = voxel;
    options.threshold = 0;
    options.max_optical_depth = 0;
    const auto path = scratch(fmt::format("cube_{}.vdb", density));
    VdbWriteOptions write;
    write.half_precision = false;
    write_vdb(path, sample_volume(geometry, source, options), write);
    return path;
}

// Across the middle, aslant, and past it.
RayBundle rays() {
    const Tensor origins = torch::tensor({{-3.0f, 0.02f, 0.01f}, {-3.0f, 0.1f, -0.1f}, {-3.0f, 0.02f, 2.0f}});
    const Tensor directions = torch::tensor({{1.0f, 0.0f, 0.0f}, {0.96f, 0.0f, 0.28f}, {1.0f, 0.0f, 0.0f}});
    // The second goes through the middle of the cube: x = z = 0 at the same t.
    origins[1][2] = -3.0f * 0.28f / 0.96f;
    origins[1][1] = 0.02f;
    return {origins, directions};
}

TEST(GridView, EvenCubeIsBeerAndLambert) {
    for (const FieldGeometry& geometry : {FieldGeometry(), turned_geometry()}) {
        for (const double density : {0.05, 1.0, 30.0}) {
            const RenderedRays drawn = render_grids(cube(geometry, density, 0.02), geometry, rays());
            const double straight = 2 * half_side, aslant = straight / 0.96;
            for (const auto& [ray, length] : {std::pair{0, straight}, {1, aslant}}) {
                const double alpha = -std::expm1(-density * length);
                // The grid's edge is soft by a voxel.
                EXPECT_NEAR(drawn.alpha[ray].item<float>(), alpha, 0.02 * density * std::exp(-density * length) + 2e-4);
                EXPECT_NEAR(drawn.color[ray][0].item<float>(), 0.8 * drawn.alpha[ray].item<float>(), 1e-4);
                EXPECT_NEAR(drawn.color[ray][2].item<float>(), 0.2 * drawn.alpha[ray].item<float>(), 1e-4);
            }
            EXPECT_EQ(drawn.alpha[2].item<float>(), 0);
            EXPECT_EQ(drawn.depth[2].item<float>(), 0);
            // ∫ σ e^{−σt} t dt / alpha from the near face on.
            const double a = density * straight;
            const double mean = (1 - (1 + a) * std::exp(-a)) / density / -std::expm1(-a);
            EXPECT_NEAR(drawn.depth[0].item<float>(), 3 - half_side + mean, 0.02);
        }
    }
}

TEST(GridView, FinerStepsChangeLittle) {
    const FieldGeometry geometry;
    const auto path = cube(geometry, 5, 0.02);
    GridViewOptions fine;
    fine.step = 0.05;
    const RenderedRays usual = render_grids(path, geometry, rays()), finer = render_grids(path, geometry, rays(), fine);
    EXPECT_LT((usual.color - finer.color).abs().max().item<float>(), 2e-3);
}

TEST(GridView, RefusesWhatIsNoGrid) {
    EXPECT_THROW(render_grids(scratch("missing.vdb"), {}, rays()), InputError);
    GridViewOptions options;
    options.step = 0;
    EXPECT_THROW(render_grids(scratch("missing.vdb"), {}, rays(), options), std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
