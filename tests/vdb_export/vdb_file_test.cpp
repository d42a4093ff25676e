#include <gtest/gtest.h>

#include <unistd.h>
#include <cmath>
#include <cstdlib>
#include <map>

#include "core/base/errors.h"
#include "core/base/files.h"
#include "vdb_export/sparse_volume.h"

namespace fieldgraft {
namespace {

std::filesystem::path scratch(const std::string& name) {
    const auto folder = std::filesystem::temp_directory_path() / fmt::format("fieldgraft_vdb_{}", getpid());
    std::filesystem::create_directories(folder);
    return folder / name;
}

using Index = std::array<int, 3>;

template <class Value>
std::map<Index, Value> by_index(const Tensor& index, const Tensor& values) {
    std::map<Index, Value> result;
    for (std::int64_t i = 0; i < index.size(0); ++i) {
        const int* at = index.data_ptr<int>() + 3 * i;
        const float* value =
            values.data_ptr<float>() + i * (values.numel() / std::max<std::int64_t>(1, values.size(0)));
        if constexpr (std::is_same_v<Value, float>) {
            result[{at[0], at[1], at[2]}] = *value;
        } else {
            result[{at[0], at[1], at[2]}] = {value[0], value[1], value[2]};
        }
    }
    return result;
}

// A few voxels in two blocks that are far apart, with a turned transform.
SparseVolume two_blocks() {
    SparseVolume volume;
    volume.origins = torch::tensor({0, 8, -16, 800, 0, 8}, at::kInt).view({2, 3});
    volume.density = at::zeros({2, block_voxels}, at::kFloat);
    volume.color = at::zeros({2, block_voxels, 3}, at::kFloat);
    volume.density[0][64 * 3 + 8 * 4 + 5] = 2.5;
    volume.color[0][64 * 3 + 8 * 4 + 5] = torch::tensor({0.25, 0.5, 1.0});
    volume.density[1][0] = 0.125;
    volume.color[1][0] = torch::tensor({1.0, 0.0, 0.5});
    volume.index_to_world = {0, -0.5, 0, 7, 0.5, 0, 0, -3, 0, 0, 0.5, 0.25, 0, 0, 0, 1};
    volume.metadata = {{"prompt", "red ball"}};
    return volume;
}

TEST(VdbFile, KeepsVoxelsTransformAndMetadata) {
    const auto path = scratch("two.vdb");
    const VdbFigures figures = write_vdb(path, two_blocks(), {.half_precision = true, .color_dilation = 0});
    EXPECT_EQ(figures.voxels, 2);
    EXPECT_EQ(figures.bytes, std::filesystem::file_size(path));
    const VdbContents read = read_vdb(path);
    EXPECT_TRUE(read.half_precision);
    const auto density = by_index<float>(read.density_index, read.density);
    const std::map<Index, float> expected{{{3, 12, -11}, 2.5f}, {{800, 0, 8}, 0.125f}};
    EXPECT_EQ(density, expected);
    const auto color = by_index<std::array<float, 3>>(read.color_index, read.color);
    EXPECT_EQ(color.at({3, 12, -11}), (std::array<float, 3>{0.25f, 0.5f, 1.0f}));
    EXPECT_EQ(read.metadata.at("prompt"), "red ball");
    for (int i = 0; i < 16; ++i) EXPECT_NEAR(read.index_to_world[i], two_blocks().index_to_world[i], 1e-12) << i;
}

TEST(VdbFile, FillsColoursAroundActiveVoxels) {
    SparseVolume volume = two_blocks();
    for (const int rounds : {1, 2}) {
        const auto path = scratch("filled.vdb");
        const VdbFigures figures = write_vdb(path, volume, {.half_precision = false, .color_dilation = rounds});
        const int cube = (2 * rounds + 1) * (2 * rounds + 1) * (2 * rounds + 1);
        EXPECT_EQ(figures.voxels, 2);
        EXPECT_EQ(figures.color_voxels, 2 * cube);
        const VdbContents contents = read_vdb(path);
        const auto color = by_index<std::array<float, 3>>(contents.color_index, contents.color);
        for (const auto& [index, value] : color) {
            const bool first = index[0] < 400;
            EXPECT_NEAR(value[0], first ? 0.25f : 1.0f, 1e-6);
            EXPECT_NEAR(value[2], first ? 1.0f : 0.5f, 1e-6);
        }
        EXPECT_EQ(by_index<float>(contents.density_index, contents.density).size(), 2u);
    }
    // Between two colours: the mean of both.
    volume.density[0][64 * 3 + 8 * 4 + 7] = 1.0;
    volume.color[0][64 * 3 + 8 * 4 + 7] = torch::tensor({0.75, 0.5, 0.0});
    const auto path = scratch("between.vdb");
    write_vdb(path, volume, {.half_precision = false, .color_dilation = 1});
    const VdbContents contents = read_vdb(path);
    const auto between = by_index<std::array<float, 3>>(contents.color_index, contents.color).at({3, 12, -10});
    EXPECT_NEAR(between[0], 0.5f, 1e-6);
    EXPECT_NEAR(between[2], 0.5f, 1e-6);
}

TEST(VdbFile, KeepsFullFloatsWhereHalfWouldOverflow) {
    SparseVolume volume = two_blocks();
    volume.density[1][0] = 1e6;
    const auto path = scratch("large.vdb");
    EXPECT_FALSE(write_vdb(path, volume).half_precision);
    const VdbContents read = read_vdb(path);
    EXPECT_EQ(by_index<float>(read.density_index, read.density).at({800, 0, 8}), 1e6f);
}

TEST(VdbFile, RefusesWhatItCannotWriteAndLeavesTheOldFile) {
    const auto path = scratch("kept.vdb");
    write_vdb(path, two_blocks());
    const std::string before = read_file(path);
    SparseVolume volume = two_blocks();
    volume.density[0][0] = std::nan("");
    EXPECT_THROW(write_vdb(path, volume), std::invalid_argument);
    volume = two_blocks();
    volume.color = volume.color.narrow(0, 0, 1);
    EXPECT_THROW(write_vdb(path, volume), std::invalid_argument);
    EXPECT_THROW(write_vdb(path, two_blocks(), {.color_dilation = -1}), std::invalid_argument);
    EXPECT_EQ(read_file(path), before);
}

TEST(VdbFile, ReadingBrokenFilesIsOneLine) {
    const auto message = [](const std::filesystem::path& path) -> std::string {
        try {
            read_vdb(path);
        } catch (const InputError& error) {
            return error.what();
        }
        return "";
    };
    EXPECT_NE(message(scratch("absent.vdb")).find("no such file"), std::string::npos);
    write_file(scratch("text.vdb"), "not a volume at all, but long enough to hold a header");
    EXPECT_NE(message(scratch("text.vdb")).find("not a readable .vdb"), std::string::npos);
    const auto whole = scratch("whole.vdb");
    write_vdb(whole, two_blocks());
    write_file(scratch("cut.vdb"), read_file(whole).substr(0, std::filesystem::file_size(whole) / 2));
    EXPECT_NE(message(scratch("cut.vdb")).find("not a readable .vdb"), std::string::npos);
}

// The volume that the Blender tests render (tests/blender/blob.py has the same formulas): the committed file is what
// write_vdb makes of them. FIELDGRAFT_UPDATE_GOLDEN=1 writes it anew.
SparseVolume blob() {
    constexpr int count = 24;
    constexpr double voxel = 0.08;
    const double cz = std::cos(0.5), sz = std::sin(0.5), cx = std::cos(0.3), sx = std::sin(0.3);
    const double rotation[3][3] = {{cz, -sz * cx, sz * sx}, {sz, cz * cx, -cz * sx}, {0, sx, cx}};
    const double shift[3] = {0.1, -0.05, 0.2};
    SparseVolume volume;
    for (int row = 0; row < 3; ++row) {
        double offset = shift[row];
        for (int column = 0; column < 3; ++column) {
            volume.index_to_world[4 * row + column] = voxel * rotation[row][column];
            offset -= 0.5 * (count - 1) * voxel * rotation[row][column];
        }
        volume.index_to_world[4 * row + 3] = offset;
    }
    std::vector<int> origins;
    std::vector<float> density, color;
    for (int b = 0; b < 27; ++b) {
        const int corner[3] = {b / 9 * 8, b / 3 % 3 * 8, b % 3 * 8};
        origins.insert(origins.end(), corner, corner + 3);
        for (int v = 0; v < block_voxels; ++v) {
            const double x = (corner[0] + v / 64 - 0.5 * (count - 1)) * voxel;
            const double y = (corner[1] + v / 8 % 8 - 0.5 * (count - 1)) * voxel;
            const double z = (corner[2] + v % 8 - 0.5 * (count - 1)) * voxel;
            const double r2 = x * x + y * y / 0.8 + z * z / 0.6;
            density.push_back(static_cast<float>(8 * std::max(0.0, 1 - r2 / 0.55)));
            color.push_back(static_cast<float>(0.5 + 0.5 * std::sin(5 * x)));
            color.push_back(static_cast<float>(0.5 + 0.5 * std::sin(4 * y)));
            color.push_back(static_cast<float>(0.5 + 0.4 * std::cos(6 * z)));
        }
    }
    volume.origins = torch::tensor(origins, at::kInt).view({-1, 3});
    volume.density = torch::tensor(density).view({-1, block_voxels});
    volume.color = torch::tensor(color).view({-1, block_voxels, 3});
    return volume;
}

TEST(VdbFile, CommittedBlobIsWhatIsWritten) {
    const std::filesystem::path committed = std::filesystem::path(FIELDGRAFT_SOURCE_DIR) / "tests/blender/blob.vdb";
    if (std::getenv("FIELDGRAFT_UPDATE_GOLDEN") != nullptr) write_vdb(committed, blob());
    const auto path = scratch("blob.vdb");
    write_vdb(path, blob());
    const VdbContents ours = read_vdb(path), golden = read_vdb(committed);
    EXPECT_TRUE(ours.density_index.equal(golden.density_index));
    EXPECT_TRUE(ours.density.equal(golden.density));
    EXPECT_TRUE(ours.color_index.equal(golden.color_index));
    EXPECT_TRUE(ours.color.equal(golden.color));
    for (int i = 0; i < 16; ++i) EXPECT_NEAR(ours.index_to_world[i], golden.index_to_world[i], 1e-12);
}

}  // namespace
}  // namespace fieldgraft
