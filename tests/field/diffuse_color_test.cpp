#include "core/field/diffuse_color.h"

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace fieldgraft {
namespace {

TEST(DiffuseColor, ViewDirectionsLookDownFromTheHemisphere) {
    FieldGeometry geometry;
    geometry.up = {0, 2, 0};
    const Tensor directions = view_directions_of(geometry, 64);
    EXPECT_LT((directions.norm(2, 1) - 1).abs().max().item<double>(), 1e-6);
    const Tensor down = -directions.select(1, 1);
    EXPECT_GT(down.min().item<double>(), 0);
    EXPECT_NEAR(down.mean().item<double>(), 0.5, 1e-3);  // even by area
    EXPECT_LT(directions.mean(0)[0].abs().item<double>(), 0.05);
    EXPECT_LT(directions.mean(0)[2].abs().item<double>(), 0.05);
    geometry.forward_facing = true;
    EXPECT_NEAR(view_directions_of(geometry, 64).select(1, 1).mean().item<double>(), 0, 1e-3);
    EXPECT_THROW(view_directions_of(geometry, 0), std::invalid_argument);
    geometry.up = {0, 0, 0};
    EXPECT_THROW(view_directions_of(geometry), std::invalid_argument);
}

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

TEST(DiffuseColor, IsTheMeanOverDirections) {
    const auto field = small_field();
    const Tensor x = positions(70);
    const Tensor features = field->density(x).features, directions = view_directions_of(field->geometry());
    Tensor mean = at::zeros({70, 3}, at::kFloat);
    for (std::int64_t d = 0; d < directions.size(0); ++d) {
        mean += field->color(features, directions[d].expand({70, 3}).contiguous()) / directions.size(0);
    }
    EXPECT_LT((diffuse_color(*field, features) - mean).abs().max().item<double>(), 1e-5);
    EXPECT_EQ(diffuse_color(*field, features.narrow(0, 0, 0)).size(0), 0);
}

}  // namespace
}  // namespace fieldgraft
