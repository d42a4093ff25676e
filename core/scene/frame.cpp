#include "core/scene/frame.h"

#include "core/base/errors.h"

namespace fieldgraft {

namespace {

double determinant(const std::array<double, 12>& m) {
    return m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) +
           m[2] * (m[4] * m[9] - m[5] * m[8]);
}

// Empty if m is a similarity, else what is wrong with it.
std::string fault(const std::array<double, 12>& m) {
    for (const double value : m)
        if (!std::isfinite(value)) return fmt::format("it holds the value {}", value);
    const double det = determinant(m);
    if (!(det > 0)) return fmt::format("its determinant is {}; a rotation times a scale > 0 is needed", det);
    const double scale2 = std::pow(det, 2.0 / 3.0);
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j <= i; ++j) {
            const double product = m[4 * i] * m[4 * j] + m[4 * i + 1] * m[4 * j + 1] + m[4 * i + 2] * m[4 * j + 2];
            const double error = std::abs(product / scale2 - (i == j ? 1.0 : 0.0));
            if (error > 1e-4)
                return fmt::format("rows {} and {} are {:.2g} away from a rotation times a scale", i, j, error);
        }
    }
    return "";
}

}  // namespace

Frame Frame::make(double scale, const std::array<double, 9>& r, const Vec3& t) {
    if (!(scale > 0)) throw std::invalid_argument(fmt::format("Frame: scale {} is not > 0", scale));
    std::array<double, 12> m;
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) m[4 * i + j] = scale * r[3 * i + j];
        m[4 * i + 3] = scale * t[i];
    }
    return from_matrix(m);
}

Frame Frame::from_matrix(const std::array<double, 12>& matrix) {
    if (const std::string text = fault(matrix); !text.empty())
        throw std::invalid_argument("Frame: not a similarity: " + text);
    return Frame{matrix};
}

Frame Frame::from_json(const Json& json, const std::string& where) {
    const auto bad = [&](const std::string& what) {
        input_error("{}: {}; {{\"transform\": 3 rows of 4 numbers, \"scale\": number > 0}} is needed", where, what);
    };
    if (!json.is_object() || !json.contains("transform")) bad("no \"transform\"");
    const Json& rows = json["transform"];
    if (!rows.is_array() || rows.size() < 3 || rows.size() > 4) bad("\"transform\" has no 3 rows");
    const Json scale = json.value("scale", Json(1.0));
    if (!scale.is_number() || !(scale.get<double>() > 0)) bad("\"scale\" is " + scale.dump());
    std::array<double, 12> m;
    for (int i = 0; i < 3; ++i) {
        if (!rows[i].is_array() || rows[i].size() != 4) bad(fmt::format("row {} of \"transform\" has no 4 numbers", i));
        for (int j = 0; j < 4; ++j) {
            if (!rows[i][j].is_number()) bad(fmt::format("\"transform\"[{}][{}] is {}", i, j, rows[i][j].dump()));
            m[4 * i + j] = scale.get<double>() * rows[i][j].get<double>();
        }
    }
    if (const std::string text = fault(m); !text.empty()) bad("\"transform\" is no similarity: " + text);
    return Frame{m};
}

Json Frame::to_json() const {
    const double s = scale();
    Json rows = Json::array();
    for (int i = 0; i < 3; ++i) {
        rows.push_back(Json::array());
        for (int j = 0; j < 4; ++j) rows[i].push_back(matrix[4 * i + j] / s);
    }
    return {{"transform", rows}, {"scale", s}};
}

double Frame::scale() const {
    return std::cbrt(determinant(matrix));
}

Frame Frame::inverse() const {
    // (sR)⁻¹ = (sR)ᵀ / s².
    const double s = scale(), inverse2 = 1.0 / (s * s);
    Frame result;
    for (int i = 0; i < 3; ++i) {
        double shift = 0;
        for (int j = 0; j < 3; ++j) {
            result.matrix[4 * i + j] = matrix[4 * j + i] * inverse2;
            shift += result.matrix[4 * i + j] * matrix[4 * j + 3];
        }
        result.matrix[4 * i + 3] = 0.0 - shift;
    }
    return result;
}

Vec3 Frame::point(const Vec3& p) const {
    Vec3 result;
    for (int i = 0; i < 3; ++i)
        result[i] = matrix[4 * i] * p[0] + matrix[4 * i + 1] * p[1] + matrix[4 * i + 2] * p[2] + matrix[4 * i + 3];
    return result;
}

Mat4 Frame::pose(const Mat4& c2w) const {
    const double s = scale();
    Mat4 result = identity4;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            result[4 * i + j] =
                (matrix[4 * i] * c2w[j] + matrix[4 * i + 1] * c2w[4 + j] + matrix[4 * i + 2] * c2w[8 + j]) / s;
    const Vec3 position = point(position_of(c2w));
    for (int i = 0; i < 3; ++i) result[4 * i + 3] = position[i];
    return result;
}

Frame compose(const Frame& second, const Frame& first) {
    Frame result;
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 4; ++j) {
            double sum = j == 3 ? second.matrix[4 * i + 3] : 0.0;
            for (int k = 0; k < 3; ++k) sum += second.matrix[4 * i + k] * first.matrix[4 * k + j];
            result.matrix[4 * i + j] = sum;
        }
    }
    return result;
}

}  // namespace fieldgraft
