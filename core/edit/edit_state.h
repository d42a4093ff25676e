// Everything an edit's training needs to go on exactly where it stopped, as one checkpoint file.
//
// Tensors: g's parameters, Adam's moments, the region. Metadata: iteration, seconds, random state, learning-rate
// back-off, skipped steps, the specification and what it was trained over. Written atomically; a resumed run of a fixed
// number of iterations on one thread ends in the same file as an uninterrupted one.
#pragma once

#include <filesystem>

#include "core/edit/adam.h"
#include "core/edit/base_medium.h"
#include "core/edit/region_finder.h"

namespace fieldgraft {

struct EditState {
    int iteration = 0;
    double seconds = 0;        // spent on iterations so far
    double tower_seconds = 0;  // of these, in the guide
    Random random{0, 1};
    double back_off = 1;  // factor on the learning rate, lowered after bad gradients
    int skipped = 0, skipped_in_a_row = 0;
};

void save_checkpoint(const std::filesystem::path& path, const EditState& state, const EditField& field,
                     const Adam& adam, const EditRegion& region, const Json& identity);

struct Checkpoint {
    EditState state;
    std::map<std::string, Tensor> tensors;
    EditRegion region;
    // Copies the parameters into `field` and the moments into `adam`.
    void restore(EditField& field, Adam& adam) const;
};
// Throws InputError when the file is not a checkpoint, or one of another edit: `identity` (specification, field, stack,
// guide) must be the one it was saved with.
Checkpoint load_checkpoint(const std::filesystem::path& path, const Json& identity);

}  // namespace fieldgraft
