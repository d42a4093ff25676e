// Activations as the networks' kernels take them, made from the references' layout.
#pragma once

#include <vector>

#include "core/kernels/field_mlp_simd.h"

namespace fieldgraft::testing {

// Rows of `width`, padded with zeros, of a feature-major width×n array.
inline std::vector<float> rows_of(const std::vector<double>& columns, int width, int n) {
    std::vector<float> rows(std::size_t(n) * padded(width), 0.0f);
    for (int s = 0; s < n; ++s) {
        for (int i = 0; i < width; ++i)
            rows[std::size_t(s) * padded(width) + i] = float(columns[std::size_t(i) * n + s]);
    }
    return rows;
}

}  // namespace fieldgraft::testing
