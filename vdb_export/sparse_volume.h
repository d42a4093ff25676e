// A sampled volume as blocks of 8×8×8 voxels, the leaf nodes of an OpenVDB tree, and its way to and from a .vdb file.
//
// Block b covers the index coordinates origins[b] … origins[b] + 7; voxel (x, y, z) of it is at 64x + 8y + z (OpenVDB's
// leaf order). index_to_world is 4×4 row-major, column vectors: integer index coordinates are voxel centres. Density is
// per unit of length of that world; colours are as the field holds them (sRGB-encoded), only used where density > 0.
//
// In the file: grids "density" (float) and "color" (vec3f), active where there is density; colour is filled further out
// (see fill_colors), because renderers interpolate colour and density apart. Values are stored as half floats when
// asked: relative error 2⁻¹¹, above 65504 infinite (so write_vdb then keeps full floats).
#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <string>

#include "core/base/torch.h"

namespace fieldgraft {

constexpr int block_edge = 8;
constexpr int block_voxels = block_edge * block_edge * block_edge;

struct SparseVolume {
    Tensor origins;  // B×3 int32, multiples of 8
    Tensor density;  // B×512 float32, ≥ 0; 0 = not active
    Tensor color;    // B×512×3 float32
    std::array<double, 16> index_to_world{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    std::map<std::string, std::string> metadata;
};

struct VdbWriteOptions {
    bool half_precision = true;
    int color_dilation = 2;  // voxels beyond active density that get a colour
};

struct VdbFigures {
    std::int64_t voxels = 0;        // active in "density"
    std::int64_t color_voxels = 0;  // active in "color"
    std::uintmax_t bytes = 0;
    bool half_precision = false;  // as written
};

// Atomic. Throws std::invalid_argument for wrong shapes, Failure when the file cannot be written.
VdbFigures write_vdb(const std::filesystem::path& path, const SparseVolume& volume,
                     const VdbWriteOptions& options = {});

// What a file holds, voxel by voxel. Throws InputError: missing, not a .vdb, no "density" or "color" grid.
struct VdbContents {
    Tensor density_index;  // N×3 int32, active voxels
    Tensor density;        // N float32
    Tensor color_index;    // M×3 int32
    Tensor color;          // M×3 float32
    std::array<double, 16> index_to_world{};
    std::map<std::string, std::string> metadata;
    bool half_precision = false;
};
VdbContents read_vdb(const std::filesystem::path& path);

}  // namespace fieldgraft
