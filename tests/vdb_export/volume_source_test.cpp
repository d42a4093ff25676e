#include "vdb_export/volume_source.h"

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/field/diffuse_color.h"

namespace fieldgraft {
namespace {

std::shared_ptr<RadianceField> small_field() {
    HashFieldConfig config;
    config.levels = 4;
    config.log2_table_size = 12;
    config.finest_resolution = 32;
    auto field = std::make_shared<RadianceField>(config, FieldGeometry{}, 11);
    field->freeze();
    return field;
}

Tensor positions(int count) {
    Random random(5);
    Tensor x = at::empty({count, 3}, at::kFloat);
    for (int i = 0; i < 3 * count; ++i) x.data_ptr<float>()[i] = random.uniform(-1.4f, 1.4f);
    return x;
}

StackItem edit_of(const RadianceField& field, const std::string& operations, std::uint64_t seed) {
    EditFieldConfig config;
    config.operations = Operations::parse(operations);
    return {std::make_shared<EditField>(config, field.geometry(), seed)};
}

// Two edits, one after the other, against the formulas written out voxel by voxel in double.
TEST(VolumeSource, StackIsEvaluatedLevelByLevel) {
    const auto field = small_field();
    const Tensor x = positions(40);
    EditStack edits{edit_of(*field, "add,change", 1), edit_of(*field, "remove,add", 2)};
    edits[0].change = 0.5f;
    edits[1].remove = 0.25f;
    edits[1].add = 0.75f;
    at::NoGradGuard no_grad;
    const auto base = field->density(x);
    const Tensor base_color = diffuse_color(*field, base.features);
    const EditSamples lower = edits[0].field->evaluate(x), upper = edits[1].field->evaluate(x);
    const VolumeSource source = volume_source(*field, edits);
    const Tensor density = source.density(x), color = source.color(x);
    for (int i = 0; i < 40; ++i) {
        const double sigma0 = base.density[i].item<double>();
        const double sigma1 = sigma0 + lower.density_e[i].item<double>();
        const double kept = (1 - 0.25 * upper.beta_density[i].item<double>()) * sigma1;
        const double added = 0.75 * upper.density_e[i].item<double>();
        EXPECT_NEAR(density[i].item<double>(), kept + added, 1e-5 * (kept + added));
        for (int c = 0; c < 3; ++c) {
            const double beta = 0.5 * lower.beta_color[i].item<double>(), mine = lower.color_e[i][c].item<double>();
            const double changed = (1 - beta) * base_color[i][c].item<double>() + beta * mine;
            const double below = (sigma0 * changed + (sigma1 - sigma0) * mine) / sigma1;
            const double expected = (kept * below + added * upper.color_e[i][c].item<double>()) / (kept + added);
            EXPECT_NEAR(color[i][c].item<double>(), expected, 1e-5);
        }
    }
}

TEST(VolumeSource, StrengthZeroIsTheFieldBitForBit) {
    const auto field = small_field();
    const Tensor x = positions(40);
    EditStack edits{edit_of(*field, "add,remove,change", 1)};
    edits[0].add = edits[0].remove = edits[0].change = 0;
    const VolumeSource source = volume_source(*field, edits), plain = volume_source(*field, {});
    EXPECT_TRUE(source.density(x).equal(plain.density(x)));
    EXPECT_TRUE(source.color(x).equal(plain.color(x)));
}

TEST(VolumeSource, NothingIsOutsideTheOccupiedCells) {
    const auto field = small_field();
    Tensor occupancy = at::zeros({2, 2, 2}, at::kByte);
    occupancy[1][0][1] = 1;  // z > 0, y < 0, x > 0
    field->set_occupancy(occupancy);
    const Tensor x = positions(200);
    const Tensor inside = (x.select(1, 0) > 0).logical_and(x.select(1, 1) < 0).logical_and(x.select(1, 2) > 0);
    const VolumeSource source = volume_source(*field, {});
    EXPECT_TRUE((source.density(x) > 0).equal(inside));
    EXPECT_EQ(source.occupancy.size(), 1u);
    // An edit that adds and whose support is not fixed may add anywhere.
    EXPECT_TRUE(volume_source(*field, {edit_of(*field, "add", 1)}).occupancy.empty());
    EXPECT_GT(volume_source(*field, {edit_of(*field, "add", 1)}).density(x).min().item<double>(), 0);
}

}  // namespace
}  // namespace fieldgraft
