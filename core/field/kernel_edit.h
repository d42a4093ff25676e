// An editable field g as the kernels read it, with the strengths of its place in a stack: no tensors, no graph.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/field/edit_field.h"
#include "core/kernels/edit_mlp_simd.h"

namespace fieldgraft {

// A grid of cells over a box, asked for points in the unit cube (whose edge is the box's longest).
class UnitCells {
  public:
    // R×R×R uint8 (z, y, x); undefined: the whole box.
    UnitCells(const FieldGeometry& geometry, const Tensor& grid);
    bool holds(float x, float y, float z) const;

  private:
    std::vector<std::uint8_t> marks_;
    std::int64_t resolution_ = 0;  // 0: the whole box
    float cells_[3]{};             // a unit along each axis
};

class KernelEdit {
  public:
    struct Strengths {
        float add = 1, remove = 1, change = 1;
    };
    // `edit` must outlive it.
    KernelEdit(const EditField& edit, const Strengths& strengths);

    // Where a sample's values lie in its row.
    static constexpr std::size_t density_e = 0, color_e = 1, beta_density = 4, beta_color = 5, row = 6;
    // positions 3×n in the unit cube. Writes the values of sample s, times their strengths, to rows[s·stride …]; those
    // of operations that are off, and of samples where g does not act, stay as they are. One thread.
    void evaluate(const float* positions, std::size_t n, float* rows, std::size_t stride) const;

  private:
    const EditNetwork* network_;
    Tensor table_;
    EditMlpWeights weights_;
    UnitCells support_;
    struct Output {
        std::size_t place;  // in the row
        bool wanted;
        float strength;
    };
    std::vector<Output> outputs_;
};

}  // namespace fieldgraft
