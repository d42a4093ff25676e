#include "vdb_export/vdb_export.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>

#include "core/base/errors.h"
#include "core/field/diffuse_color.h"
#include "vdb_export/sampling.h"
#include "vdb_export/sparse_volume.h"
#include "vdb_export/volume_source.h"

namespace fieldgraft {
namespace {

std::filesystem::path scratch(const std::string& name) {
    const auto folder = std::filesystem::temp_directory_path() / fmt::format("fieldgraft_bake_{}", getpid());
    std::filesystem::create_directories(folder);
    return folder / name;
}

// A turned, scaled and shifted world.
FieldGeometry turned_geometry() {
    FieldGeometry geometry;
    const double c = std::cos(0.4), s = std::sin(0.4), scale = 0.5;
    geometry.frame = {scale * c, -scale * s, 0, 0.4, scale * s, scale * c, 0, -0.2, 0, 0, scale, 0.1};
    return geometry;
}

// A small field as it starts out: smooth noise around density 1, random colours; occupied in one corner only.
std::shared_ptr<RadianceField> small_field(const FieldGeometry& geometry) {
    HashFieldConfig config;
    config.levels = 4;
    config.log2_table_size = 12;
    config.finest_resolution = 32;
    auto field = std::make_shared<RadianceField>(config, geometry, 7);
    field->freeze();
    Tensor occupancy = at::zeros({8, 8, 8}, at::kByte);
    occupancy.slice(0, 0, 4).slice(1, 4, 8).slice(2, 2, 5).fill_(1);
    field->set_occupancy(occupancy);
    return field;
}

EditFile small_edit(const RadianceField& field, const std::string& operations, float strength) {
    EditFieldConfig config;
    config.operations = Operations::parse(operations);
    EditFile edit;
    edit.field = std::make_shared<EditField>(config, field.geometry(), 3);
    Tensor support = at::zeros({8, 8, 8}, at::kByte);
    support.slice(0, 2, 6).fill_(1);
    edit.field->set_support(support);
    edit.field_hash = field.hash();
    edit.specification = {{"target", "a red ball"}};
    edit.strength_add = edit.strength_remove = edit.strength_change = strength;
    return edit;
}

struct Sampled {
    Tensor positions, density, color;  // model coordinates, as stored in the file
    VdbContents file;
};

// The file's voxels with their places taken back through the world transform and the frame.
Sampled read_back(const std::filesystem::path& path, const FieldGeometry& geometry) {
    Sampled out;
    out.file = read_vdb(path);
    const Tensor world_matrix = torch::tensor(at::ArrayRef<double>(out.file.index_to_world), at::kDouble).view({4, 4});
    const Tensor frame = torch::tensor(at::ArrayRef<double>(geometry.frame), at::kDouble).view({3, 4});
    const auto apply = [](const Tensor& m, const Tensor& x) {
        return at::matmul(x, m.narrow(0, 0, 3).narrow(1, 0, 3).t()) + m.narrow(0, 0, 3).select(1, 3);
    };
    const Tensor world = apply(world_matrix, out.file.density_index.to(at::kDouble));
    out.positions = apply(frame, world).to(at::kFloat);
    out.density = out.file.density;
    return out;
}

// 32 voxels along the box, which is 6 long in the world.
const BakeOptions plain{
    .voxel_size = 6.0 / 32, .threshold = 0, .max_optical_depth = 0, .supersample = 1, .color_dilation = 0};

double worst_relative(const Tensor& a, const Tensor& b) {
    return ((a - b).abs() / b.abs().clamp_min(1e-3)).max().item<double>();
}

TEST(Bake, FileHoldsTheFieldAtVoxelCentres) {
    const FieldGeometry geometry = turned_geometry();
    const auto field = small_field(geometry);
    const auto path = scratch("field.vdb");
    const BakeReport report = bake(*field, {}, path, plain);
    const Sampled read = read_back(path, geometry);
    EXPECT_EQ(report.voxels, 16 * 16 * 12);  // 4×4×3 of 8³ cells are occupied
    EXPECT_EQ(read.density.size(0), report.voxels);
    EXPECT_EQ(report.bytes, std::filesystem::file_size(path));
    EXPECT_NEAR(report.voxel_size, 3.0 / 32 / 0.5, 1e-9);
    const Tensor expected = volume_source(*field, {}).density(read.positions) * 0.5;  // per unit of the world
    EXPECT_LT(worst_relative(read.density, expected), 1e-3);                          // half precision: 2⁻¹¹
    const Tensor color = diffuse_color(*field, field->density(read.positions).features);
    ASSERT_TRUE(read.file.color_index.equal(read.file.density_index));
    EXPECT_LT((read.file.color - color).abs().max().item<double>(), 1e-3);
    EXPECT_EQ(read.file.metadata.at("fieldgraft_field"), field->hash());
}

// With an edit the file holds the blended medium; with strength 0 the bytes are those without the edit.
TEST(Bake, FileHoldsTheBlendedMedium) {
    const FieldGeometry geometry = turned_geometry();
    const auto field = small_field(geometry);
    const auto path = scratch("edited.vdb");
    for (const std::string operations : {"change", "remove", "add", "add,remove,change"}) {
        const std::vector<EditFile> edits{small_edit(*field, operations, 0.75f)};
        const EditStack stack{stack_item(edits[0])};
        bake(*field, edits, path, plain);
        const Sampled read = read_back(path, geometry);
        EXPECT_LT(worst_relative(read.density, volume_source(*field, stack).density(read.positions) * 0.5), 1e-3)
            << operations;
        const Tensor color = volume_source(*field, stack).color(read.positions);
        EXPECT_LT((read.file.color - color).abs().max().item<double>(), 1e-3) << operations;
        EXPECT_EQ(read.file.metadata.at("fieldgraft_prompts"), "a red ball");

        bake(*field, {small_edit(*field, operations, 0.0f)}, path, plain);
        const Sampled off = read_back(path, geometry);
        EXPECT_LT(worst_relative(off.density, volume_source(*field, {}).density(off.positions) * 0.5), 1e-3)
            << operations;
    }
}

TEST(Bake, AddedDensityOutsideTheFieldsCellsIsThere) {
    const auto field = small_field(turned_geometry());
    const auto without = bake(*field, {}, scratch("without.vdb"), plain);
    const auto with = bake(*field, {small_edit(*field, "add", 1.0f)}, scratch("with.vdb"), plain);
    EXPECT_GT(with.voxels, without.voxels);
}

TEST(Bake, ChoosesResolutionOrVoxelSize) {
    const auto field = small_field(turned_geometry());
    BakeOptions options = plain;
    const auto by_size = bake(*field, {}, scratch("size.vdb"), options);
    options.voxel_size = 0;
    options.resolution = 16;  // what there is, is half as long as the box
    const auto by_count = bake(*field, {}, scratch("count.vdb"), options);
    EXPECT_EQ(by_size.voxels, by_count.voxels);
    EXPECT_NEAR(by_size.voxel_size, by_count.voxel_size, 1e-9);
    options.voxel_size = 1e-6;
    EXPECT_THROW(bake(*field, {}, scratch("fine.vdb"), options), InputError);
    options.voxel_size = 0;
    options.resolution = 4;
    EXPECT_THROW(bake(*field, {}, scratch("coarse.vdb"), options), InputError);
    options = plain;
    options.supersample = 0;
    EXPECT_THROW(bake(*field, {}, scratch("none.vdb"), options), InputError);
    EXPECT_FALSE(std::filesystem::exists(scratch("none.vdb")));
}

TEST(Bake, AnEmptyFieldIsAClearFailure) {
    const auto field = small_field(turned_geometry());
    field->set_occupancy(at::zeros({8, 8, 8}, at::kByte));
    try {
        bake(*field, {}, scratch("empty.vdb"), plain);
        FAIL() << "an empty field was baked";
    } catch (const Failure& error) {
        EXPECT_NE(std::string(error.what()).find("nothing to bake"), std::string::npos);
    }
    EXPECT_FALSE(std::filesystem::exists(scratch("empty.vdb")));
}

}  // namespace
}  // namespace fieldgraft
