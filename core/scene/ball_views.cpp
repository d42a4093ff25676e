#include "core/scene/ball_views.h"

#include <cmath>

namespace fieldgraft {

Tensor ball_pixels(const Camera& camera) {
    const Rays rays = rays_of_view(camera);
    const Tensor b = (rays.origins * rays.directions).sum(1), c = rays.origins.square().sum(1) - 0.36;
    const Tensor discriminant = b * b - c, hit = discriminant > 0;
    const Tensor t = -b - discriminant.clamp_min(0).sqrt();
    const Tensor point = rays.origins + t.unsqueeze(1) * rays.directions;
    const Tensor color = (0.5 + 0.7 * point).clamp(0, 1);
    const Tensor rgba = at::cat({color, hit.to(at::kFloat).unsqueeze(1)}, 1) * hit.unsqueeze(1);
    return (rgba * 255).round().to(at::kByte).view({camera.height, camera.width, 4}).contiguous();
}

std::vector<Camera> ball_cameras(int count, int size) {
    std::vector<Camera> cameras;
    for (int i = 0; i < count; ++i) {
        const double angle = 0.8 * i, height = i % 2 ? 1.0 : -0.6;
        const Vec3 eye{3 * std::cos(angle), 3 * std::sin(angle), height};
        cameras.push_back(camera_from_angle(size, size, 0.7, look_at(eye, {0, 0, 0}, {0, 0, 1})));
    }
    return cameras;
}

}  // namespace fieldgraft
