// Which cells of the box may hold something, learnt while the field is: R³ cells (z slowest) with a fading memory of
// density.
//
//   v ← max(0.9·v, σ(a random point of the cell))   occupied: v > min(0.9·mean v, threshold),  threshold·step = 0.01
//
// (Müller et al. 2022, appendix C). refresh_all looks into every cell; refresh_some into 1/32 of the cells, in turn,
// and into as many random occupied ones. All randomness comes from the caller's generator. What no camera can see is
// never occupied: nothing would ever teach the field that it is empty.
#pragma once

#include "core/base/random.h"
#include "core/field/radiance_field.h"
#include "core/scene/camera.h"

namespace fieldgraft {

// R×R×R bool (z slowest): cells that may lie in some camera's picture, further than `near` (model units) from it.
// Judged for blocks of cells by the sphere around them: never too few.
Tensor seen_cells(const FieldGeometry& geometry, int resolution, const std::vector<Camera>& cameras, double near);

class OccupancyGrid {
  public:
    // `seen`: R×R×R bool; undefined: all of them.
    OccupancyGrid(const FieldGeometry& geometry, int resolution, double step, const Tensor& seen = {});
    void refresh_all(const RadianceField& field, Random& random);
    void refresh_some(const RadianceField& field, Random& random);

    Tensor cells() const;  // R×R×R uint8, 1 = occupied
    double share() const;  // of cells that are occupied
    // For checkpoints: R³ float32 and how many refreshes there were.
    const Tensor& values() const { return values_; }
    std::int64_t turn() const { return turn_; }
    void restore(const Tensor& values, std::int64_t turn);

  private:
    void look_into(const RadianceField& field, const std::vector<std::int64_t>& cells, Random& random);
    float limit() const;

    FieldGeometry geometry_;
    std::int64_t resolution_;
    double threshold_;
    Tensor values_, seen_;
    std::int64_t turn_ = 0;
};

}  // namespace fieldgraft
