#include "core/kernels/spherical_harmonics_ref.h"

#include <stdexcept>
#include <string>

namespace fieldgraft {

template <class T>
void spherical_harmonics(int degree, std::span<const T> directions, std::span<T> values) {
    if (degree < 1 || degree > 4) {
        throw std::invalid_argument("spherical harmonics: degree must be 1 to 4, not " + std::to_string(degree));
    }
    const std::size_t n = directions.size() / 3;
    if (directions.size() != 3 * n || values.size() != static_cast<std::size_t>(degree) * degree * n) {
        throw std::invalid_argument("spherical harmonics: directions and values do not match");
    }
    const T *px = directions.data(), *py = px + n, *pz = py + n;
    T* out = values.data();
    const auto row = [&](int k, auto polynomial) {
        for (std::size_t i = 0; i < n; ++i) out[k * n + i] = polynomial(px[i], py[i], pz[i]);
    };
    row(0, [](T, T, T) { return T(0.28209479177387814); });
    if (degree < 2) return;
    row(1, [](T, T y, T) { return T(-0.48860251190291987) * y; });
    row(2, [](T, T, T z) { return T(0.48860251190291987) * z; });
    row(3, [](T x, T, T) { return T(-0.48860251190291987) * x; });
    if (degree < 3) return;
    row(4, [](T x, T y, T) { return T(1.0925484305920792) * x * y; });
    row(5, [](T, T y, T z) { return T(-1.0925484305920792) * y * z; });
    row(6, [](T, T, T z) { return T(0.94617469575756008) * z * z - T(0.31539156525252005); });
    row(7, [](T x, T, T z) { return T(-1.0925484305920792) * x * z; });
    row(8, [](T x, T y, T) { return T(0.54627421529603959) * (x * x - y * y); });
    if (degree < 4) return;
    row(9, [](T x, T y, T) { return T(0.59004358992664352) * y * (y * y - 3 * x * x); });
    row(10, [](T x, T y, T z) { return T(2.8906114426405538) * x * y * z; });
    row(11, [](T, T y, T z) { return T(0.45704579946446572) * y * (1 - 5 * z * z); });
    row(12, [](T, T, T z) { return T(0.3731763325901154) * z * (5 * z * z - 3); });
    row(13, [](T x, T, T z) { return T(0.45704579946446572) * x * (1 - 5 * z * z); });
    row(14, [](T x, T y, T z) { return T(1.4453057213202769) * z * (x * x - y * y); });
    row(15, [](T x, T y, T) { return T(0.59004358992664352) * x * (3 * y * y - x * x); });
}

template void spherical_harmonics<float>(int, std::span<const float>, std::span<float>);
template void spherical_harmonics<double>(int, std::span<const double>, std::span<double>);

}  // namespace fieldgraft
