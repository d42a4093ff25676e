#include "core/scene/camera.h"

#include "core/base/errors.h"
#include "core/base/shape.h"

namespace fieldgraft {

namespace {

struct Plane {
    double u, v;
};

Plane distort_opencv(const Distortion& d, Plane p) {
    const double r2 = p.u * p.u + p.v * p.v;
    const double radial = 1 + r2 * (d.k1 + r2 * (d.k2 + r2 * (d.k3 + r2 * d.k4)));
    return {p.u * radial + 2 * d.p1 * p.u * p.v + d.p2 * (r2 + 2 * p.u * p.u),
            p.v * radial + 2 * d.p2 * p.u * p.v + d.p1 * (r2 + 2 * p.v * p.v)};
}

// Newton's method on both coordinates, from the distorted point.
Plane undistort_opencv(const Distortion& d, Plane target) {
    Plane p = target;
    for (int iteration = 0; iteration < 20; ++iteration) {
        const Plane now = distort_opencv(d, p);
        const double eu = now.u - target.u, ev = now.v - target.v;
        if (std::abs(eu) + std::abs(ev) < 1e-12) break;
        const double r2 = p.u * p.u + p.v * p.v;
        const double radial = 1 + r2 * (d.k1 + r2 * (d.k2 + r2 * (d.k3 + r2 * d.k4)));
        const double slope = d.k1 + r2 * (2 * d.k2 + r2 * (3 * d.k3 + r2 * 4 * d.k4));  // d radial / d r²
        const double a = radial + 2 * p.u * p.u * slope + 2 * d.p1 * p.v + 6 * d.p2 * p.u;
        const double b = 2 * p.u * p.v * slope + 2 * d.p1 * p.u + 2 * d.p2 * p.v;
        const double c = radial + 2 * p.v * p.v * slope + 2 * d.p2 * p.u + 6 * d.p1 * p.v;
        const double det = a * c - b * b;
        if (!(std::abs(det) > 1e-12)) break;
        p.u -= (c * eu - b * ev) / det;
        p.v -= (a * ev - b * eu) / det;
    }
    return p;
}

double fisheye_angle(const Distortion& d, double theta) {
    const double t2 = theta * theta;
    return theta * (1 + t2 * (d.k1 + t2 * (d.k2 + t2 * (d.k3 + t2 * d.k4))));
}

double undistort_fisheye(const Distortion& d, double target) {
    double theta = target;
    for (int iteration = 0; iteration < 20; ++iteration) {
        const double error = fisheye_angle(d, theta) - target, t2 = theta * theta;
        if (std::abs(error) < 1e-12) break;
        const double slope = 1 + t2 * (3 * d.k1 + t2 * (5 * d.k2 + t2 * (7 * d.k3 + t2 * 9 * d.k4)));
        if (!(std::abs(slope) > 1e-9)) break;
        theta -= error / slope;
    }
    return theta;
}

// The unit direction, in camera axes, of a point of the image plane.
Vec3 camera_direction(const Camera& camera, double x, double y) {
    Plane p{(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy};
    if (camera.lens == Lens::fisheye) {
        const double distorted = std::hypot(p.u, p.v);
        const double theta = undistort_fisheye(camera.distortion, distorted);
        const double share = distorted > 1e-12 ? std::sin(theta) / distorted : 1.0;
        return {p.u * share, -p.v * share, -std::cos(theta)};
    }
    if (camera.lens == Lens::opencv) p = undistort_opencv(camera.distortion, p);
    return normalized({p.u, -p.v, -1.0});
}

Vec3 rotated(const Mat4& m, const Vec3& d) {
    return {m[0] * d[0] + m[1] * d[1] + m[2] * d[2], m[4] * d[0] + m[5] * d[1] + m[6] * d[2],
            m[8] * d[0] + m[9] * d[1] + m[10] * d[2]};
}

constexpr std::int64_t rays_a_task = 512;

// The lines of the ray tensors, each written once, in any order.
class RayWriter {
  public:
    explicit RayWriter(std::int64_t count)
        : rays_{at::empty({count, 3}, at::kFloat), at::empty({count, 3}, at::kFloat)},
          origin_(rays_.origins.data_ptr<float>()),
          direction_(rays_.directions.data_ptr<float>()) {}

    void put(std::int64_t ray, const Camera& camera, double x, double y) {
        const Vec3 position = camera.position();
        const Vec3 direction = rotated(camera.camera_to_world, camera_direction(camera, x, y));
        for (int i = 0; i < 3; ++i) origin_[3 * ray + i] = static_cast<float>(position[i]);
        for (int i = 0; i < 3; ++i) direction_[3 * ray + i] = static_cast<float>(direction[i]);
    }
    Rays take() { return std::move(rays_); }

  private:
    Rays rays_;
    float* origin_;
    float* direction_;
};

Tensor checked_pixels(const Tensor& pixels) {
    if (!pixels.defined() || pixels.dim() != 2 || pixels.size(1) != 2 || pixels.scalar_type() != at::kLong)
        throw std::invalid_argument("rays_through_pixels: pixels must be N×2 int64, got " + shape_text(pixels));
    return pixels.to(at::kCPU).contiguous();
}

void check_inside(const Camera& camera, std::int64_t x, std::int64_t y) {
    if (x < 0 || y < 0 || x >= camera.width || y >= camera.height)
        throw std::invalid_argument(
            fmt::format("rays_through_pixels: pixel ({}, {}) of a {}×{} view", x, y, camera.width, camera.height));
}

}  // namespace

void check_camera(const Camera& c) {
    const bool sized = c.width >= 1 && c.height >= 1 && c.fx > 0 && c.fy > 0;
    bool finite = std::isfinite(c.fx) && std::isfinite(c.fy) && std::isfinite(c.cx) && std::isfinite(c.cy);
    for (const double value : c.camera_to_world) finite = finite && std::isfinite(value);
    if (!sized || !finite)
        throw std::invalid_argument(
            fmt::format("camera '{}': {}×{}, focal length {} {}, centre {} {}: not a finite camera", c.name, c.width,
                        c.height, c.fx, c.fy, c.cx, c.cy));
}

Camera camera_from_angle(int width, int height, double angle_x, const Mat4& camera_to_world, std::string name) {
    Camera camera;
    camera.name = std::move(name);
    camera.width = width;
    camera.height = height;
    camera.fx = camera.fy = 0.5 * width / std::tan(0.5 * angle_x);
    camera.cx = 0.5 * width;
    camera.cy = 0.5 * height;
    camera.camera_to_world = camera_to_world;
    check_camera(camera);
    return camera;
}

Camera resized(const Camera& camera, int width, int height) {
    Camera result = camera;
    const double sx = static_cast<double>(width) / camera.width, sy = static_cast<double>(height) / camera.height;
    result.width = width;
    result.height = height;
    result.fx *= sx;
    result.cx *= sx;
    result.fy *= sy;
    result.cy *= sy;
    check_camera(result);
    return result;
}

Camera scaled(const Camera& camera, double factor) {
    if (!(factor > 0) || !std::isfinite(factor))
        throw std::invalid_argument(fmt::format("scaled: factor {} is not > 0", factor));
    const auto side = [&](int pixels) { return std::max(1, static_cast<int>(std::lround(pixels * factor))); };
    return resized(camera, side(camera.width), side(camera.height));
}

Camera square(const Camera& camera, int size) {
    const int side = std::min(camera.width, camera.height);
    Camera result = camera;
    result.cx -= 0.5 * (camera.width - side);
    result.cy -= 0.5 * (camera.height - side);
    result.width = result.height = side;
    return resized(result, size, size);
}

Camera transformed(const Camera& camera, const Frame& frame) {
    Camera result = camera;
    result.camera_to_world = frame.pose(camera.camera_to_world);
    result.near *= frame.scale();
    result.far *= frame.scale();
    return result;
}

Rays rays_through_pixels(const Camera& camera, const Tensor& pixels) {
    check_camera(camera);
    const Tensor list = checked_pixels(pixels);
    const auto* xy = list.data_ptr<std::int64_t>();
    RayWriter writer(list.size(0));
    at::parallel_for(0, list.size(0), rays_a_task, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i) {
            const std::int64_t x = xy[2 * i], y = xy[2 * i + 1];
            check_inside(camera, x, y);
            writer.put(i, camera, static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
        }
    });
    return writer.take();
}

Rays rays_through_pixels(const std::vector<Camera>& cameras, const Tensor& view, const Tensor& pixels) {
    const Tensor list = checked_pixels(pixels);
    if (!view.defined() || view.dim() != 1 || view.size(0) != list.size(0) || view.scalar_type() != at::kLong)
        throw std::invalid_argument(
            fmt::format("rays_through_pixels: view must be {} int64 values, got {}", list.size(0), shape_text(view)));
    for (const Camera& camera : cameras) check_camera(camera);
    const Tensor views = view.to(at::kCPU).contiguous();
    const auto* index = views.data_ptr<std::int64_t>();
    const auto* xy = list.data_ptr<std::int64_t>();
    RayWriter writer(list.size(0));
    at::parallel_for(0, list.size(0), rays_a_task, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i) {
            if (index[i] < 0 || index[i] >= static_cast<std::int64_t>(cameras.size()))
                throw std::invalid_argument(
                    fmt::format("rays_through_pixels: view {} of {}", index[i], cameras.size()));
            const Camera& camera = cameras[static_cast<std::size_t>(index[i])];
            const std::int64_t x = xy[2 * i], y = xy[2 * i + 1];
            check_inside(camera, x, y);
            writer.put(i, camera, static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
        }
    });
    return writer.take();
}

Rays rays_through_points(const Camera& camera, const Tensor& points) {
    check_camera(camera);
    if (!points.defined() || points.dim() != 2 || points.size(1) != 2 || !points.is_floating_point())
        throw std::invalid_argument("rays_through_points: points must be N×2 floating point, got " +
                                    shape_text(points));
    const Tensor list = points.detach().to(at::kCPU, at::kDouble).contiguous();
    const double* xy = list.data_ptr<double>();
    RayWriter writer(list.size(0));
    at::parallel_for(0, list.size(0), rays_a_task, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i) writer.put(i, camera, xy[2 * i], xy[2 * i + 1]);
    });
    return writer.take();
}

Rays rays_of_view(const Camera& camera) {
    check_camera(camera);
    RayWriter writer(std::int64_t{camera.width} * camera.height);
    at::parallel_for(0, camera.height, 4, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t y = begin; y < end; ++y) {
            for (std::int64_t x = 0; x < camera.width; ++x) {
                writer.put(y * camera.width + x, camera, static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
            }
        }
    });
    return writer.take();
}

Tensor project(const Camera& camera, const Tensor& points) {
    check_camera(camera);
    if (!points.defined() || points.dim() != 2 || points.size(1) != 3)
        throw std::invalid_argument("project: points must be N×3, got " + shape_text(points));
    const Tensor list = points.detach().to(at::kCPU, at::kDouble).contiguous();
    Tensor result = at::empty({list.size(0), 3}, at::kDouble);
    const double* in = list.data_ptr<double>();
    double* out = result.data_ptr<double>();
    const Mat4& m = camera.camera_to_world;
    for (std::int64_t i = 0; i < list.size(0); ++i, in += 3, out += 3) {
        const Vec3 offset = Vec3{in[0], in[1], in[2]} - camera.position();
        const Vec3 local{dot(column(m, 0), offset), -dot(column(m, 1), offset), -dot(column(m, 2), offset)};
        out[0] = out[1] = -1;
        out[2] = local[2];
        if (!(local[2] > 0)) continue;
        Plane p{local[0] / local[2], local[1] / local[2]};
        if (camera.lens == Lens::opencv) p = distort_opencv(camera.distortion, p);
        if (camera.lens == Lens::fisheye) {
            const double r = std::hypot(p.u, p.v);
            const double share = r > 1e-12 ? fisheye_angle(camera.distortion, std::atan(r)) / r : 1.0;
            p = {p.u * share, p.v * share};
        }
        out[0] = camera.fx * p.u + camera.cx;
        out[1] = camera.fy * p.v + camera.cy;
    }
    return result;
}

}  // namespace fieldgraft
