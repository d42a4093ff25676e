// Cameras to look at an edit from while it is trained (Blending-NeRF, sec. 4.3: the view is drawn anew every
// iteration).
//
// Hemisphere: positions uniform over the area of the part of a sphere between two elevations above `centre`, the radius
// uniform in its range, looking at a point drawn from a ball around the centre. Near poses (forward-facing scenes,
// where half the sphere was never seen): between a training camera and one of its nearest neighbours, slightly moved
// and turned.
#pragma once

#include <vector>

#include "core/base/random.h"
#include "core/scene/camera.h"

namespace fieldgraft {

struct HemisphereOptions {
    Vec3 centre{0, 0, 0}, up{0, 0, 1};
    double radius_min = 4, radius_max = 4;
    double elevation_min = 0, elevation_max = 90;  // degrees above the plane at right angles to `up`
    double focus_radius = 0;                       // the ball the looked-at point is drawn from
    Camera intrinsics;                             // size, focal lengths, lens: everything but the pose
};
// Throws std::invalid_argument for radii that are not 0 < min ≤ max, focus_radius ≥ radius_min, elevations outside
// [−90, 90].
Camera sample_hemisphere(const HemisphereOptions& options, Random& random);

struct NearPoseOptions {
    int neighbours = 4;            // how many of the nearest cameras may be the other end
    double position_jitter = 0.1;  // of the distance to that neighbour, standard deviation
    double angle_jitter = 1.0;     // degrees, standard deviation
};
// At least one camera; with exactly one only the angle is jittered.
Camera sample_near_poses(const std::vector<Camera>& cameras, const NearPoseOptions& options, Random& random);

// Whether the far side of the scene was never seen: all cameras look within 30° of their mean direction, or within 60°
// and, around their mean up, into one half circle only (a ring of cameras that looks down from all sides is not
// forward-facing).
bool is_forward_facing(const std::vector<Camera>& cameras);
// The point nearest to all viewing axes (least squares); for nearly parallel axes a point in front of the cameras'
// mean.
Vec3 focus_point(const std::vector<Camera>& cameras);

}  // namespace fieldgraft
