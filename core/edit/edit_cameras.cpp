#include "core/edit/edit_cameras.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/base/errors.h"

namespace fieldgraft {

EditCameras::EditCameras(const FieldGeometry& geometry, const EditSpec& spec, const Scene* scene)
    : geometry_(geometry), zoom_(spec.zoom), focus_(geometry.centre) {
    if (!geometry_.forward_facing) return;
    if (scene != nullptr) poses_ = scene->cameras("train");
    if (poses_.empty())
        input_error("this field was seen from one side only: give its --scene, whose cameras the edit looks through");
}

Camera EditCameras::intrinsics() const {
    Camera camera;
    camera.width = geometry_.image_width;
    camera.height = geometry_.image_height;
    camera.fx = geometry_.focal_x;
    camera.fy = geometry_.focal_y;
    camera.cx = geometry_.principal_x;
    camera.cy = geometry_.principal_y;
    return camera;
}

Camera EditCameras::draw(Random& random) const {
    Camera camera;
    if (!poses_.empty()) {
        camera = sample_near_poses(poses_, {}, random);
    } else {
        HemisphereOptions options;
        options.centre = focus_;
        options.up = geometry_.up;
        options.radius_min = geometry_.radius_range[0];
        options.radius_max = std::max(geometry_.radius_range[0], geometry_.radius_range[1]);
        options.focus_radius = 0.03 * options.radius_min;
        options.intrinsics = intrinsics();
        camera = sample_hemisphere(options, random);
    }
    const double zoom = zoom_[0] + (zoom_[1] - zoom_[0]) * random.uniform();
    camera.fx *= zoom;
    camera.fy *= zoom;
    return camera;
}

std::vector<Camera> EditCameras::survey(int count, int size) const {
    std::vector<Camera> cameras;
    if (!poses_.empty()) {
        const int views = std::min<int>(count, static_cast<int>(poses_.size()));
        for (int i = 0; i < views; ++i) cameras.push_back(square(poses_[i * poses_.size() / views], size));
        return cameras;
    }
    // A Fibonacci spiral over the hemisphere between 10° and 75° above the ground: even, and the same every time.
    const Vec3 up = normalized(geometry_.up), side = any_normal(up), front = cross(up, side);
    const double low = std::sin(10 * std::numbers::pi / 180), high = std::sin(75 * std::numbers::pi / 180);
    const double radius = (geometry_.radius_range[0] + geometry_.radius_range[1]) / 2;
    for (int i = 0; i < count; ++i) {
        const double height = low + (high - low) * (i + 0.5) / count;
        const double angle = i * std::numbers::pi * (3 - std::sqrt(5.0)), ring = std::sqrt(1 - height * height);
        const Vec3 offset = height * up + ring * std::cos(angle) * side + ring * std::sin(angle) * front;
        Camera camera = intrinsics();
        camera.camera_to_world = look_at(geometry_.centre + radius * offset, geometry_.centre, up);
        camera.name = fmt::format("survey {}", i + 1);
        cameras.push_back(square(camera, size));
    }
    return cameras;
}

}  // namespace fieldgraft
