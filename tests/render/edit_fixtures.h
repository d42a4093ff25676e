// A small field with a ball of density in the middle, rays through it, and edits over it, for the tests of blended
// views.
#pragma once

#include <gtest/gtest.h>

#include "core/field/cells.h"
#include "core/render/blended_view.h"

namespace fieldgraft {

inline Tensor ball_cells(const FieldGeometry& geometry, int resolution, std::array<float, 3> centre, float radius) {
    const Tensor cells = at::arange(std::int64_t{1} * resolution * resolution * resolution, at::kLong);
    const Tensor points = cell_points(geometry, resolution, cells, {0.5, 0.5, 0.5});
    const Tensor distance = (points - torch::tensor({centre[0], centre[1], centre[2]})).norm(2, 1);
    return distance.lt(radius).to(at::kByte).view({resolution, resolution, resolution});
}

// Random weights made dense and lively: an opaque-ish ball of radius 0.6 at the centre of the box ±1.5.
inline std::shared_ptr<RadianceField> ball_field() {
    HashFieldConfig config;
    config.levels = 4;
    config.log2_table_size = 12;
    config.base_resolution = 8;
    config.finest_resolution = 64;
    config.density_hidden = config.color_hidden = 16;
    auto field = std::make_shared<RadianceField>(config, FieldGeometry{}, 3);
    at::NoGradGuard no_grad;
    field->parameters().at("encoding.table").mul_(1e4);
    field->parameters().at("density.1").mul_(3);
    field->parameters().at("color.0").mul_(2);
    field->set_occupancy(ball_cells(field->geometry(), 32, {0, 0, 0}, 0.6f));
    field->freeze();
    return field;
}

// An edit with lively weights whose support is a ball.
inline std::shared_ptr<EditField> ball_edit(const std::string& operations, std::array<float, 3> centre, float radius,
                                            std::uint64_t seed = 7) {
    EditFieldConfig config;
    config.operations = Operations::parse(operations);
    config.resolutions = {4, 8};
    config.hidden = 16;
    config.initial_beta = 0.4;
    config.initial_density = 0.05;
    auto edit = std::make_shared<EditField>(config, FieldGeometry{}, seed);
    at::NoGradGuard no_grad;
    for (const auto& [name, parameter] : edit->parameters()) {
        if (name.ends_with(".weight")) parameter.mul_(4);
    }
    edit->set_support(ball_cells(edit->geometry(), 32, centre, radius));
    return edit;
}

// size×size parallel rays along +y over the box's front.
inline RayBundle front_rays(int size) {
    const Tensor line = (at::arange(size, at::kFloat) + 0.5) / size * 2.6 - 1.3;
    const Tensor x = line.repeat({size}), z = -line.repeat_interleave(size);
    return {at::stack({x, at::full_like(x, -3), z}, 1).contiguous(),
            torch::tensor({0.0f, 1.0f, 0.0f}).expand({x.size(0), 3}).contiguous()};
}

inline bool same_bits(const Tensor& a, const Tensor& b) {
    return a.sizes() == b.sizes() && at::equal(a, b);
}

}  // namespace fieldgraft
