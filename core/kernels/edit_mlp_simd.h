// The editable field's network (edit_mlp_ref.h) over rows of samples: SIMD, dispatched at run time, float32.
//
// Layout: encoded n×R, R = row(), one row a sample, its columns past `encoded` zero but for the first of them, which is
// 1 (the bias' input). Outputs are columns in arrays of more samples than are asked: sample s of output k is
// data[k][index[s]·step[k]]; an output without data is not written, its gradient is 0. One thread; callers split
// samples, and add up the gradients of their parts.
//
// The hidden layer is computed again in the backward pass. A NaN reaches every output that depends on it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/kernels/edit_mlp_ref.h"

namespace fieldgraft {

template <class T>
struct EditColumns {
    std::array<T*, 16> data{};
    std::array<std::size_t, 16> step{};
    const std::int64_t* index = nullptr;
};

// The same numbers as the kernels read them, padded, each matrix both ways. Throws std::invalid_argument: sizes.
class EditMlpWeights {
  public:
    EditMlpWeights(const EditMlpShape& shape, const EditMlpMatrices<const float>& matrices);
    const EditMlpShape& shape() const { return shape_; }
    int row() const { return row_; }
    int hidden() const { return hidden_; }

    // (encoded and bias)×hidden, hidden×(the same), hidden×16, outputs×hidden, 16.
    std::vector<float> first, first_back, last, last_back, last_bias;

  private:
    EditMlpShape shape_;
    int row_, hidden_;
};

// Sums of gradients, in×out, padded.
struct EditMlpGradients {
    explicit EditMlpGradients(const EditMlpWeights& weights);
    void add(const EditMlpGradients& other);
    // += into matrices laid out like EditMlpMatrices.
    void add_to(const EditMlpShape& shape, const EditMlpMatrices<float>& matrices) const;

    int row, hidden;
    std::vector<float> first, last, last_bias;
};

void edit_mlp_forward(const EditMlpWeights& weights, const float* encoded, int n, const EditColumns<float>& outputs);
// Adds to the gradients; writes encoded_grad n×R, whose columns past `encoded` mean nothing.
void edit_mlp_backward(const EditMlpWeights& weights, const float* encoded, int n,
                       const EditColumns<const float>& output_grads, EditMlpGradients& gradients, float* encoded_grad);

}  // namespace fieldgraft
