// What an edit is trained over: the field f with the edits below this one, seen as one medium (no gradients anywhere).
//
//   level n over n−1:  σ = (1 − s_r βσ) σ_below + s_a σᵉ,   c = Σ σ c / Σ σ  (the conserving mixture of its parts),
//   with c_below turned towards cᵉ by s_c βc; s_add, s_remove, s_change are the edits' strengths
//
// Positions N×3 model coordinates, directions N×3 unit vectors; densities N per model unit, colours N×3.
#pragma once

#include <memory>
#include <vector>

#include "core/render/march.h"
#include "core/render/medium.h"

namespace fieldgraft {

// One view's samples of a medium that an edit can only take away from within `acting`.
struct BaseSamples {
    Samples samples;
    Tensor density, color;  // N, N×3
    Tensor acting;          // N bool: within the cells where the edit may act (all true without such cells)
};

struct BaseQuery {
    Tensor extra_cells;      // R³ uint8: visited beside the medium's own occupied cells; may be undefined
    Tensor acting_cells;     // R³ uint8: where the edit may act; undefined: everywhere
    bool removable = false;  // density in `acting_cells` may vanish, so what it hides is kept
    int extra_stride = 1;    // so many steps through extra cells without density are one sample
    MarchOptions march;
};

class BaseMedium {
  public:
    // Throws InputError if an edit of the stack belongs to another field.
    BaseMedium(std::shared_ptr<const RadianceField> field, const std::vector<EditFile>& stack);

    BaseSamples sample(const RayBundle& rays, const BaseQuery& query) const;
    // The cells that may hold density, R³ uint8.
    const Tensor& occupancy() const { return occupancy_; }
    const FieldGeometry& geometry() const { return field_->geometry(); }
    const std::string& field_hash() const { return field_hash_; }
    const std::vector<std::string>& stack_hashes() const { return stack_hashes_; }

  private:
    BaseSamples sample_some(const RayBundle& rays, const BaseQuery& query, const EditCells& cells) const;

    std::shared_ptr<const RadianceField> field_;
    EditStack stack_;
    std::vector<std::string> stack_hashes_;
    Tensor occupancy_;
    std::string field_hash_;
};

}  // namespace fieldgraft
