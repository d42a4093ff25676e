// Cameras an edit is trained and surveyed from (Blending-NeRF, sec. 4.1 "Volume Rendering").
//
// All-round fields: positions uniform over the upper hemisphere at a radius within the training cameras' range, looking
// at the scene's centre. Forward-facing fields: between and around the scene's training poses, which are then needed.
// Everything is in model coordinates; images have the size and focal length of a training camera.
#pragma once

#include <vector>

#include "core/base/random.h"
#include "core/edit/edit_spec.h"
#include "core/scene/camera_sampler.h"
#include "core/scene/scene.h"

namespace fieldgraft {

class EditCameras {
  public:
    // scene may be null; InputError if the field is forward-facing and no scene is given.
    EditCameras(const FieldGeometry& geometry, const EditSpec& spec, const Scene* scene);

    // A training view: drawn pose, focal length times U(zoom).
    Camera draw(Random& random) const;
    // `count` views that between them see the scene from everywhere the training cameras did; the same every time.
    std::vector<Camera> survey(int count, int size) const;
    // Look at about this point instead of the scene's centre (all-round fields).
    void set_focus(const Vec3& point) { focus_ = point; }

  private:
    Camera intrinsics() const;

    FieldGeometry geometry_;
    std::array<double, 2> zoom_;
    std::vector<Camera> poses_;  // forward-facing: the scene's
    Vec3 focus_;
};

}  // namespace fieldgraft
