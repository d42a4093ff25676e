// The trials of each sweep, and what their points are judged by.
//
//   training   a field from a scene's images: PSNR of test views against the seconds of the whole run. Every trial but
//              those of the budget takes as many iterations as the usual setting does in its time.
//   rendering  pictures of a field with its edits: PSNR to the converged pictures (an eighth of the usual step, nothing
//              left out, conserving) against seconds a view
//   editing    one edit again from its own specification: MP_CLIP and S_CLIP by a judge, and the change of what no
//              region covers, against the seconds of the whole edit
//   baking     grids: PSNR of the grids' pictures to the field's own, same view-independent colour, against seconds;
//              bytes and voxels beside them
#pragma once

#include <memory>

#include "core/edit/edit_loop.h"
#include "core/profile/trial.h"
#include "core/render/blended_view.h"

namespace fieldgraft {

const std::vector<std::string>& known_sweeps();
// The first is what a chart shows first. Throws std::invalid_argument for an unknown sweep.
std::vector<Measure> measures_of(const std::string& sweep);
// What the time axis counts.
std::string time_of(const std::string& sweep);

struct RenderingInputs {
    std::shared_ptr<const RadianceField> field;
    EditStack stack;
    std::vector<Camera> cameras;
    int repeats = 3;
};
std::vector<Trial> rendering_trials(const RenderingInputs& inputs);

struct TrainingInputs {
    const Scene* scene = nullptr;
    std::vector<View> views;  // measured on
    double minutes = 1;       // of the usual setting
    std::uint64_t seed = 0;
};
std::vector<Trial> training_trials(const TrainingInputs& inputs);

struct EditingInputs {
    EditInputs base;
    EditSpec spec;  // the usual setting
    std::shared_ptr<Guidance> judge;
    // Guides to compare: a name and how to load it; the first is the usual one.
    std::vector<std::pair<std::string, std::function<std::shared_ptr<Guidance>()>>> guides;
    std::vector<Camera> cameras;
};
std::vector<Trial> editing_trials(const EditingInputs& inputs);

struct BakingInputs {
    std::shared_ptr<const RadianceField> field;
    std::vector<EditFile> edits;
    std::vector<Camera> cameras;
    std::filesystem::path scratch;  // a folder for grids; they are removed
    int resolution = 256;           // of the usual setting
};
std::vector<Trial> baking_trials(const BakingInputs& inputs);

}  // namespace fieldgraft
