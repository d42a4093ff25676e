// How long the part of a field's box is that holds something, so that a bake's resolution counts voxels over the thing
// and not over the emptiness a box leaves around it.
#pragma once

#include "vdb_export/sampling.h"

namespace fieldgraft {

// The longest edge (model units) of the axis-aligned box that holds what there is, found on a grid of 128 voxels along
// the field's box; a thousandth of the optical depth may lie outside on each side, so that a floater does not count.
// Never more than the field's box, which it is where nothing is found. `options` as for sample_volume, but for the
// voxel.
// It looks at voxels of a 128th of the field's box, and counts those that hold something.
struct Content {
    double edge = 0;          // model units
    std::int64_t voxels = 0;  // of a 128th of the box's edge
};
Content content_of(const FieldGeometry& geometry, const VolumeSource& medium, SamplingOptions options);
double content_edge(const FieldGeometry& geometry, const VolumeSource& medium, SamplingOptions options);

}  // namespace fieldgraft
