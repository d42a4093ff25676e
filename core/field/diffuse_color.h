// A field's colour without view dependence: what a baked volume can hold.
//
// The mean of RadianceField::color over `diffuse_directions` view directions, spread evenly over those that cameras on
// the upper hemisphere look along (over the whole sphere for forward-facing scenes). An edit's colours do not depend on
// the direction and colours mix linearly, so the mean of a stack's colour is the stack over this mean. No gradients.
//
// Shapes: features N×feature_size (RadianceField::density) → N×3; directions D×3, unit vectors along the rays.
#pragma once

#include "core/field/radiance_field.h"

namespace fieldgraft {

constexpr int diffuse_directions = 16;

// Throws std::invalid_argument for count < 1 or an up axis of length 0.
Tensor view_directions_of(const FieldGeometry& geometry, int count = diffuse_directions);
Tensor diffuse_color(const RadianceField& field, const Tensor& features);

}  // namespace fieldgraft
