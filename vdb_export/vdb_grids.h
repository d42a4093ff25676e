// The two grids of a baked file, as OpenVDB holds them.
#pragma once

#include <openvdb/openvdb.h>

#include <filesystem>

namespace fieldgraft {

struct VdbGrids {
    openvdb::FloatGrid::Ptr density = openvdb::FloatGrid::create(0.0f);
    openvdb::Vec3SGrid::Ptr color = openvdb::Vec3SGrid::create(openvdb::Vec3f(0.0f));
    openvdb::MetaMap::Ptr metadata;  // the file's; null for grids that come from none
};

// Throws InputError: missing, not a .vdb, no "density" or "color" grid.
VdbGrids load_grids(const std::filesystem::path& path);

}  // namespace fieldgraft
