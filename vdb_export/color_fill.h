// Colour beyond the surface: renderers interpolate colour and density apart, so the voxels around active ones need a
// colour too (0 there would darken every edge). Each round gives the voxels that touch a coloured one (26 neighbours)
// the mean of their coloured neighbours. Not differentiable.
#pragma once

#include <openvdb/openvdb.h>

namespace fieldgraft {

void fill_colors(openvdb::Vec3SGrid& color, int rounds);

}  // namespace fieldgraft
