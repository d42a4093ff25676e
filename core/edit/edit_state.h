// Everything an edit's training needs to go on exactly where it stopped, as one checkpoint file.
//
// Tensors: g's parameters, Adam's moments, the region. Metadata: iteration, seconds, random state, what the guard of
// the steps knows, the specification and what it was trained over. Written atomically; a resumed run of a fixed number
// of iterations on one thread ends in the same file as an uninterrupted one.
#pragma once

#include <filesystem>

#include "core/edit/adam.h"
#include "core/edit/base_medium.h"
#include "core/edit/region_finder.h"
#include "core/train/step_guard.h"

namespace fieldgraft {

struct EditState {
    int iteration = 0;
    double seconds = 0;        // spent on iterations so far
    double tower_seconds = 0;  // of these, in the guide
    Random random{0, 1};
    GuardState guard;  // steps left out, roll-backs, the learning rate's factor
};

// g's parameters ("p.") and Adam's moments and count ("adam."): what a run has learnt, and how it is copied back. The
// parameters share g's memory.
std::map<std::string, Tensor> learnt(const EditField& field, const Adam& adam);
// Throws InputError: something is missing or has another shape.
void put_back(const std::map<std::string, Tensor>& tensors, EditField& field, Adam& adam);

// Throws Failure instead of writing numbers that are not finite.
void save_checkpoint(const std::filesystem::path& path, const EditState& state, const EditField& field,
                     const Adam& adam, const EditRegion& region, const Json& identity);

struct Checkpoint {
    EditState state;
    std::map<std::string, Tensor> tensors;
    EditRegion region;
};
// Throws InputError when the file is not a checkpoint, not finite, or one of another edit: `identity` (specification,
// field, stack, guide) must be the one it was saved with.
Checkpoint load_checkpoint(const std::filesystem::path& path, const Json& identity);

}  // namespace fieldgraft
