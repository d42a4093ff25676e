#include "vdb_export/color_fill.h"

#include <openvdb/tools/Morphology.h>
#include <openvdb/tree/LeafManager.h>

namespace fieldgraft {
namespace {

// The mean over the active voxels among the 26 neighbours of `at`; there is at least one.
openvdb::Vec3f neighbour_mean(const openvdb::Vec3STree& tree,
                              openvdb::tree::ValueAccessor<const openvdb::Vec3STree>& known, const openvdb::Coord& at) {
    openvdb::Vec3f sum(0.0f), value;
    int count = 0;
    for (int x = -1; x <= 1; ++x) {
        for (int y = -1; y <= 1; ++y) {
            for (int z = -1; z <= 1; ++z) {
                if (!known.probeValue(at.offsetBy(x, y, z), value)) continue;
                sum += value;
                ++count;
            }
        }
    }
    return count > 0 ? sum / static_cast<float>(count) : tree.background();
}

}  // namespace

void fill_colors(openvdb::Vec3SGrid& color, int rounds) {
    for (int round = 0; round < rounds; ++round) {
        const openvdb::Vec3STree before(color.tree());
        openvdb::tools::dilateActiveValues(color.tree(), 1, openvdb::tools::NN_FACE_EDGE_VERTEX);
        openvdb::tree::LeafManager<openvdb::Vec3STree> leaves(color.tree());
        leaves.foreach ([&](openvdb::Vec3STree::LeafNodeType& leaf, std::size_t) {
            openvdb::tree::ValueAccessor<const openvdb::Vec3STree> known(before);
            for (auto voxel = leaf.beginValueOn(); voxel; ++voxel) {
                if (!known.isValueOn(voxel.getCoord())) voxel.setValue(neighbour_mean(before, known, voxel.getCoord()));
            }
        });
    }
}

}  // namespace fieldgraft
