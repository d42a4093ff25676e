#include "core/scene/placement.h"

#include "core/scene/camera_sampler.h"

namespace fieldgraft {
namespace fs = std::filesystem;

namespace {

constexpr double half_box = 1.5;
constexpr std::array<double, 9> no_rotation{1, 0, 0, 0, 1, 0, 0, 0, 1};

Vec3 mean_up(const std::vector<Camera>& cameras) {
    Vec3 up{0, 0, 0};
    for (const Camera& camera : cameras) up = up + column(camera.camera_to_world, 1);
    const bool clear = length(up) > 1e-3 * static_cast<double>(cameras.size());
    return clear ? normalized(up) : Vec3{0, 0, 1};
}

// Half the side of the box, in the file's units, that the nerfstudio rule of scene.h asks for.
double natural_half(const std::vector<Camera>& cameras, const Vec3& focus, bool has_alpha) {
    double half = 0;
    if (has_alpha) {
        half = visible_radius(cameras, focus);
    } else {
        for (const Camera& camera : cameras)
            for (const double offset : camera.position() - focus) half = std::max(half, half_box * std::abs(offset));
    }
    return half > 0 ? half : half_box;
}

// q with q·p = R·(p − centre)·scale.
Frame centred(const Vec3& centre, const std::array<double, 9>& r, double scale) {
    Vec3 shift;
    for (int i = 0; i < 3; ++i)
        shift[i] = -(r[3 * i] * centre[0] + r[3 * i + 1] * centre[1] + r[3 * i + 2] * centre[2]);
    return Frame::make(scale, r, shift);
}

Placement from_dataparser(const TransformsFile& file, const fs::path& path, const std::vector<Camera>& cameras,
                          bool has_alpha) {
    // nerfstudio trains at (scale / applied_scale)·transform∘A⁻¹ of the file's poses, A the applied_transform alone.
    Frame applied = file.applied;
    for (double& value : applied.matrix) value /= file.applied_scale;
    Frame result = compose(Frame::from_json(read_json(path), path.string()), applied.inverse());
    for (double& value : result.matrix) value /= file.applied_scale;
    Bounds box;
    if (has_alpha) {
        std::vector<Camera> placed;
        for (const Camera& camera : cameras) placed.push_back(transformed(camera, result));
        const Vec3 focus = focus_point(placed);
        const double half = natural_half(placed, focus, has_alpha);
        box = {focus - Vec3{half, half, half}, focus + Vec3{half, half, half}};
    }
    return {result, box};
}

}  // namespace

double visible_radius(const std::vector<Camera>& cameras, const Vec3& focus) {
    std::vector<double> radii;
    for (const Camera& camera : cameras) {
        const double tangent = 0.5 * std::max(camera.width / camera.fx, camera.height / camera.fy);
        radii.push_back(length(camera.position() - focus) * tangent);
    }
    if (radii.empty()) return 0;
    const auto middle = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 2);
    std::nth_element(radii.begin(), middle, radii.end());
    return *middle;
}

std::array<double, 9> rotation_between(const Vec3& from, const Vec3& to) {
    const Vec3 a = normalized(from), b = normalized(to);
    const double c = dot(a, b);
    if (c < -1 + 1e-12) {  // half a turn about any axis at a right angle
        const Vec3 n = any_normal(a);
        std::array<double, 9> r;
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) r[3 * i + j] = 2 * n[i] * n[j] - (i == j ? 1 : 0);
        return r;
    }
    const Vec3 v = cross(a, b);
    const double k = 1 / (1 + c);
    return {c + k * v[0] * v[0],    k * v[0] * v[1] - v[2], k * v[0] * v[2] + v[1],
            k * v[0] * v[1] + v[2], c + k * v[1] * v[1],    k * v[1] * v[2] - v[0],
            k * v[0] * v[2] - v[1], k * v[1] * v[2] + v[0], c + k * v[2] * v[2]};
}

Bounds mapped_box(const Bounds& box, const Frame& frame) {
    Bounds result;
    for (int corner = 0; corner < 8; ++corner) {
        Vec3 point;
        for (int i = 0; i < 3; ++i) point[i] = (corner >> i & 1) != 0 ? box.max[i] : box.min[i];
        point = frame.point(point);
        for (int i = 0; i < 3; ++i) {
            result.min[i] = corner == 0 ? point[i] : std::min(result.min[i], point[i]);
            result.max[i] = corner == 0 ? point[i] : std::max(result.max[i], point[i]);
        }
    }
    return result;
}

Placement place_scene(const TransformsFile& file, const std::vector<Camera>& cameras, bool has_alpha) {
    const fs::path beside = file.path.parent_path() / "dataparser_transforms.json";
    if (file.dialect == Dialect::nerfstudio && fs::exists(beside))
        return from_dataparser(file, beside, cameras, has_alpha);
    if (file.dialect == Dialect::synthetic) return {};
    const Vec3 focus = focus_point(cameras);
    if (file.dialect == Dialect::ngp) {
        // A point p of the file lies at p·scale + offset in instant-ngp's unit cube, whose box has side aabb_scale
        // about ½.
        const NgpBox& box = *file.ngp_box;
        const Vec3 centre = (1 / box.scale) * (Vec3{0.5, 0.5, 0.5} - box.offset);
        const double half = std::min(0.5 * box.aabb_scale / box.scale, natural_half(cameras, centre, has_alpha));
        return {centred(centre, no_rotation, half_box / half), {}};
    }
    const auto rotation = file.keep_orientation ? no_rotation : rotation_between(mean_up(cameras), {0, 0, 1});
    return {centred(focus, rotation, half_box / natural_half(cameras, focus, has_alpha)), {}};
}

}  // namespace fieldgraft
