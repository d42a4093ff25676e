#include "core/base/errors.h"
#include "core/scene/transforms_file.h"

namespace fieldgraft {

namespace {

double cell(const Json& rows, std::size_t i, std::size_t j, const std::string& where) {
    const Json& value = rows[i][j];
    if (!value.is_number() || !std::isfinite(value.get<double>()))
        input_error("{}: transform_matrix[{}][{}] is {}; 4 rows of 4 finite numbers are needed", where, i, j,
                    value.dump());
    return value.get<double>();
}

// Divides the columns by their common length; refuses what is no rotation times a scale.
void make_rigid(Mat4& pose, const std::string& where, std::vector<std::string>& warnings) {
    std::array<Vec3, 3> axes{column(pose, 0), column(pose, 1), column(pose, 2)};
    const double det = dot(axes[0], cross(axes[1], axes[2]));
    const std::array<double, 3> lengths{length(axes[0]), length(axes[1]), length(axes[2])};
    const double mean = (lengths[0] + lengths[1] + lengths[2]) / 3;
    if (!(std::abs(det) > 1e-12) || !(std::abs(det) > 1e-6 * mean * mean * mean))
        input_error("{}: transform_matrix is singular (determinant {:.3g}); a rotation and a position are needed",
                    where, det);
    if (det < 0)
        input_error("{}: transform_matrix mirrors (determinant {:.3g}); a rotation has determinant 1", where, det);
    double error = 0;
    for (int i = 0; i < 3; ++i) {
        error = std::max(error, std::abs(lengths[i] / mean - 1));
        error = std::max(error, std::abs(dot(axes[i], axes[(i + 1) % 3])) / (mean * mean));
    }
    if (error > 1e-2)
        input_error("{}: transform_matrix is not rigid (axes off by {:.2g}); remove shear and uneven scale", where,
                    error);
    if (std::abs(mean - 1) > 1e-3)
        warnings.push_back(
            fmt::format("{}: transform_matrix is scaled by {:.4g}; the scale was left out", where, mean));
    // Leave exact axes alone; straighten rounded ones (Gram–Schmidt from the viewing axis).
    if (error < 1e-6 && std::abs(mean - 1) < 1e-6) return;
    const Vec3 back = normalized(axes[2]), right = normalized(cross(axes[1], back));
    pose = from_columns(right, cross(back, right), back, position_of(pose));
}

}  // namespace

Mat4 read_pose(const Json& rows, const std::string& where, std::vector<std::string>& warnings) {
    bool shaped = rows.is_array() && (rows.size() == 4 || rows.size() == 3);
    for (std::size_t i = 0; shaped && i < rows.size(); ++i) shaped = rows[i].is_array() && rows[i].size() == 4;
    if (!shaped) input_error("{}: transform_matrix is not 4 rows of 4 numbers", where);
    Mat4 pose = identity4;
    for (std::size_t i = 0; i < rows.size(); ++i)
        for (std::size_t j = 0; j < 4; ++j) pose[4 * i + j] = cell(rows, i, j, where);
    for (int j = 0; j < 4; ++j)
        if (std::abs(pose[12 + j] - (j == 3 ? 1.0 : 0.0)) > 1e-6)
            input_error("{}: the last row of transform_matrix is [{}, {}, {}, {}]; [0, 0, 0, 1] is needed", where,
                        pose[12], pose[13], pose[14], pose[15]);
    make_rigid(pose, where, warnings);
    return pose;
}

}  // namespace fieldgraft
