#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Prune.h>

#include <limits>

#include "core/base/errors.h"
#include "core/base/files.h"
#include "vdb_export/color_fill.h"
#include "vdb_export/sparse_volume.h"
#include "vdb_export/vdb_grids.h"

namespace fieldgraft {
namespace {

constexpr float half_max = 65504.0f;

// OpenVDB multiplies row vectors from the left: its matrix is our transpose.
openvdb::math::Transform::Ptr transform_of(const std::array<double, 16>& m) {
    openvdb::Mat4d matrix;
    for (int row = 0; row < 4; ++row) {
        for (int column = 0; column < 4; ++column) matrix[column][row] = m[4 * row + column];
    }
    return openvdb::math::Transform::createLinearTransform(matrix);
}

std::array<double, 16> matrix_of(const openvdb::math::Transform& transform) {
    const openvdb::Mat4d matrix = transform.baseMap()->getAffineMap()->getMat4();
    std::array<double, 16> m{};
    for (int row = 0; row < 4; ++row) {
        for (int column = 0; column < 4; ++column) m[4 * row + column] = matrix[column][row];
    }
    return m;
}

void check(const SparseVolume& volume) {
    const std::int64_t blocks = volume.origins.size(0);
    const bool shapes = volume.origins.sizes() == at::IntArrayRef{blocks, 3} && volume.origins.dtype() == at::kInt &&
                        volume.density.sizes() == at::IntArrayRef{blocks, block_voxels} &&
                        volume.color.sizes() == at::IntArrayRef{blocks, block_voxels, 3} &&
                        volume.density.dtype() == at::kFloat && volume.color.dtype() == at::kFloat;
    if (!shapes) {
        throw std::invalid_argument(
            fmt::format("sparse volume of {} blocks: density must be {}×{}, colour {}×{}×3, float32", blocks, blocks,
                        block_voxels, blocks, block_voxels));
    }
    const bool finite =
        at::isfinite(volume.density).all().item<bool>() && at::isfinite(volume.color).all().item<bool>();
    if (!finite) throw std::invalid_argument("sparse volume: a density or colour is not finite");
}

void insert_blocks(const SparseVolume& volume, VdbGrids& grids) {
    const Tensor origins = volume.origins.contiguous(), density = volume.density.contiguous();
    const Tensor color = volume.color.contiguous();
    const int* origin = origins.data_ptr<int>();
    const float* sigma = density.data_ptr<float>();
    const float* rgb = color.data_ptr<float>();
    for (std::int64_t b = 0; b < origins.size(0); ++b, origin += 3, sigma += block_voxels, rgb += 3 * block_voxels) {
        const openvdb::Coord corner(origin[0], origin[1], origin[2]);
        auto* density_leaf = grids.density->tree().touchLeaf(corner);
        auto* color_leaf = grids.color->tree().touchLeaf(corner);
        for (openvdb::Index v = 0; v < block_voxels; ++v) {
            if (!(sigma[v] > 0.0f)) continue;
            density_leaf->setValueOn(v, sigma[v]);
            color_leaf->setValueOn(v, openvdb::Vec3f(rgb[3 * v], rgb[3 * v + 1], rgb[3 * v + 2]));
        }
    }
    openvdb::tools::pruneInactive(grids.density->tree());
    openvdb::tools::pruneInactive(grids.color->tree());
}

void describe(const SparseVolume& volume, bool half, VdbGrids& grids) {
    grids.density->setName("density");
    grids.color->setName("color");
    grids.density->setGridClass(openvdb::GRID_FOG_VOLUME);
    for (const openvdb::GridBase::Ptr& grid :
         {openvdb::GridBase::Ptr(grids.density), openvdb::GridBase::Ptr(grids.color)}) {
        grid->setTransform(transform_of(volume.index_to_world));
        grid->setSaveFloatAsHalf(half);
        grid->setCreator("Fieldgraft");
    }
}

void write_file(const std::filesystem::path& path, const SparseVolume& volume, const VdbGrids& grids) {
    openvdb::MetaMap metadata;
    for (const auto& [key, value] : volume.metadata) metadata.insertMeta(key, openvdb::StringMetadata(value));
    try {
        openvdb::io::File file(path.string());
        const bool blosc = openvdb::io::Archive::hasBloscCompression();
        file.setCompression(openvdb::io::COMPRESS_ACTIVE_MASK |
                            (blosc ? openvdb::io::COMPRESS_BLOSC : openvdb::io::COMPRESS_ZIP));
        file.write({grids.density, grids.color}, metadata);
        file.close();
    } catch (const openvdb::Exception& error) {
        failure("{}: the volume could not be written ({})", path.string(), error.what());
    }
}

template <class Grid>
typename Grid::Ptr grid_named(openvdb::io::File& file, const std::string& name, const std::string& where) {
    if (!file.hasGrid(name))
        input_error("{}: no grid named \"{}\" in it; a baked field has \"density\" and \"color\"", where, name);
    auto grid = openvdb::gridPtrCast<Grid>(file.readGrid(name));
    if (!grid) input_error("{}: grid \"{}\" has another type than a baked field's", where, name);
    return grid;
}

// Active voxels of a grid: N×3 int32 and N×channels float32.
template <class Grid>
std::pair<Tensor, Tensor> active_voxels(const Grid& grid, int channels) {
    const auto count = static_cast<std::int64_t>(grid.activeVoxelCount());
    Tensor index = at::empty({count, 3}, at::kInt), values = at::empty({count, channels}, at::kFloat);
    int* at_index = index.template data_ptr<int>();
    float* value = values.template data_ptr<float>();
    for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf) {
        for (auto voxel = leaf->cbeginValueOn(); voxel; ++voxel, at_index += 3, value += channels) {
            for (int a = 0; a < 3; ++a) at_index[a] = voxel.getCoord()[a];
            if constexpr (std::is_same_v<Grid, openvdb::FloatGrid>) {
                *value = *voxel;
            } else {
                for (int c = 0; c < 3; ++c) value[c] = (*voxel)[c];
            }
        }
    }
    return {index, values};
}

}  // namespace

VdbFigures write_vdb(const std::filesystem::path& path, const SparseVolume& volume, const VdbWriteOptions& options) {
    check(volume);
    if (options.color_dilation < 0 || options.color_dilation > 64) {
        throw std::invalid_argument(
            fmt::format("colour dilation of {} voxels: 0 to 64 are possible", options.color_dilation));
    }
    openvdb::initialize();
    const bool fits_half = volume.density.numel() == 0 || volume.density.max().item<float>() <= half_max;
    VdbGrids grids;
    insert_blocks(volume, grids);
    fill_colors(*grids.color, options.color_dilation);
    describe(volume, options.half_precision && fits_half, grids);
    write_atomically(path, [&](const std::filesystem::path& temporary) { write_file(temporary, volume, grids); });
    return {static_cast<std::int64_t>(grids.density->activeVoxelCount()),
            static_cast<std::int64_t>(grids.color->activeVoxelCount()), std::filesystem::file_size(path),
            options.half_precision && fits_half};
}

VdbGrids load_grids(const std::filesystem::path& path) {
    if (!std::filesystem::is_regular_file(path)) input_error("{}: no such file", path.string());
    openvdb::initialize();
    try {
        openvdb::io::File file(path.string());
        file.open();
        VdbGrids grids{grid_named<openvdb::FloatGrid>(file, "density", path.string()),
                       grid_named<openvdb::Vec3SGrid>(file, "color", path.string()), file.getMetadata()};
        file.close();
        return grids;
    } catch (const openvdb::Exception& error) {
        input_error("{}: not a readable .vdb file ({})", path.string(), error.what());
    }
}

VdbContents read_vdb(const std::filesystem::path& path) {
    const VdbGrids grids = load_grids(path);
    VdbContents contents;
    std::tie(contents.density_index, contents.density) = active_voxels(*grids.density, 1);
    contents.density = contents.density.squeeze(1);
    std::tie(contents.color_index, contents.color) = active_voxels(*grids.color, 3);
    contents.index_to_world = matrix_of(grids.density->transform());
    contents.half_precision = grids.density->saveFloatAsHalf();
    for (auto item = grids.metadata->beginMeta(); item != grids.metadata->endMeta(); ++item) {
        contents.metadata[item->first] = item->second->str();
    }
    return contents;
}

}  // namespace fieldgraft
