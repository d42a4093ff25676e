// How long the part of a field's box is that holds something, so that a bake's resolution counts voxels over the thing
// and not over the emptiness a box leaves around it.
#pragma once

#include "vdb_export/sampling.h"

namespace fieldgraft {

// The longest edge (model units) of the axis-aligned box that holds what there is, found on a grid of 128 voxels along
// the field's box; a thousandth of the optical depth may lie outside on each side, so that a floater does not count.
// Never more than the field's box, which it is where nothing is found. `options` as for sample_volume, but for the
// voxel.
double content_edge(const FieldGeometry& geometry, const VolumeSource& medium, SamplingOptions options);

}  // namespace fieldgraft
