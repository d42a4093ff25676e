// Real spherical harmonics of a direction: the inputs that make colour depend on where it is seen from.
//
// Degree d gives d² values Y_0 … Y_{d²−1} (d = 1 … 4), orthonormal on the sphere, bands in order, m = −l … l within a
// band, with the Condon–Shortley signs of Sloan 2008, "Stupid Spherical Harmonics (SH) Tricks", appendix A2.
//
// Layout: directions 3×n and values d²×n, feature-major. Directions must have length 1 (polynomials of x, y, z
// otherwise). Not differentiated: directions come from cameras. Error ≤ 4 ε.
#pragma once

#include <span>

namespace fieldgraft {

template <class T>
void spherical_harmonics(int degree, std::span<const T> directions, std::span<T> values);

}  // namespace fieldgraft
