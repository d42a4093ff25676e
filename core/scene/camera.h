// A camera and its rays. Pixels: x to the right, y down, the centre of the first pixel at (0.5, 0.5). Camera axes as in
// OpenGL: +X right, +Y up, looks along −Z; `camera_to_world` is rigid, 4×4 row-major. Lengths are those of the
// coordinates it stands in (model coordinates once a Scene has placed it).
//
//   direction of a pixel = R·normalise(u, −v, −1),  (u, v) = undistort((x − cx)/fx, (y − cy)/fy)
//
// Lenses: pinhole; opencv (radial k1 k2 k3 k4, tangential p1 p2); fisheye (OpenCV's: θ_d = θ(1 + k1θ² + k2θ⁴ + k3θ⁶ +
// k4θ⁸)). Undistortion is iterative, to 1e-10 in (u, v); outside the range where the lens model can be inverted the
// last iterate is kept. Rays are computed in double, stored as float32, and carry no gradient.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "core/base/torch.h"
#include "core/scene/frame.h"
#include "core/scene/linear.h"

namespace fieldgraft {

enum class Lens { pinhole, opencv, fisheye };

struct Distortion {
    double k1 = 0, k2 = 0, k3 = 0, k4 = 0, p1 = 0, p2 = 0;
    bool operator==(const Distortion&) const = default;
};

struct Camera {
    std::string name;
    int width = 0, height = 0;              // pixels
    double fx = 0, fy = 0, cx = 0, cy = 0;  // pixels
    Lens lens = Lens::pinhole;
    Distortion distortion;
    Mat4 camera_to_world = identity4;
    double near = 0, far = std::numeric_limits<double>::infinity();  // along the ray

    Vec3 position() const { return position_of(camera_to_world); }
    Vec3 forward() const { return forward_of(camera_to_world); }
};

struct Rays {
    Tensor origins;     // N×3 float32
    Tensor directions;  // N×3 float32, unit length
    std::int64_t size() const { return origins.size(0); }
};

// Throws std::invalid_argument unless sizes and focal lengths are positive and all numbers finite.
void check_camera(const Camera& camera);
// A pinhole camera of that horizontal angle (radians), square pixels, principal point at the centre.
Camera camera_from_angle(int width, int height, double angle_x, const Mat4& camera_to_world, std::string name = "");
// The same view with another number of pixels; `scaled` rounds the size (at least 1×1).
Camera resized(const Camera& camera, int width, int height);
Camera scaled(const Camera& camera, double factor);
// The largest centred square of the view as size×size pixels.
Camera square(const Camera& camera, int size);
// The camera after its world is mapped by the frame (near and far scale along).
Camera transformed(const Camera& camera, const Frame& frame);

// Rays through pixel centres: pixels N×2 int64 (x, y), inside the image. No rays (N = 0) are fine.
Rays rays_through_pixels(const Camera& camera, const Tensor& pixels);
// Ray i through pixel pixels[i] of cameras[view[i]]; view N int64.
Rays rays_through_pixels(const std::vector<Camera>& cameras, const Tensor& view, const Tensor& pixels);
// Rays through points of the image plane, N×2 floating point, in pixels.
Rays rays_through_points(const Camera& camera, const Tensor& points);
// All rays of the view, row by row: ray y·width + x.
Rays rays_of_view(const Camera& camera);

// World points N×3 → N×3 float64 (x, y in pixels, depth along the viewing axis). Points with depth ≤ 0 are behind the
// camera: their x and y are meaningless (set to −1).
Tensor project(const Camera& camera, const Tensor& points);

}  // namespace fieldgraft
