// Training an edit (Blending-NeRF, sec. 4): cameras, patches, blended pictures, losses, Adam, in that order, many
// times.
//
//   L = L_clip + w_region L_region + w_opacity Σ max(τ, mean E) + w_reg mean H(E_add) + w_smooth L_smooth
//
// f, the edits below and the guide are frozen; only g learns. Each iteration renders one S×S patch, augments original,
// blended and edit picture alike and asks the guide; the guide's gradient to the pictures is then carried through the
// renderer together with the localised losses. What goes wrong with a step is core/train/step_guard.h's matter: left
// out, rolled back, or in the end Failure with the last good state saved. Afterwards the support is fixed and g is
// exactly 0 outside it; figures are taken then.
//
// Events: plan, progress {iteration, total, loss, eta_s, terms}, preview {path} (original | edit | map: red removed,
// green added, blue changed), warning. Times in seconds; `field` seconds leave out the guide's towers and the
// segmenter.
#pragma once

#include "core/base/progress.h"
#include "core/edit/edit_plan.h"
#include "core/edit/region_finder.h"

namespace fieldgraft {

struct EditInputs {
    std::shared_ptr<const RadianceField> field;
    std::vector<EditFile> stack;  // edits below this one, the lowest first
    std::shared_ptr<Guidance> guide;
    const Scene* scene = nullptr;  // its poses and the views of user masks; may be null
};

struct EditRunOptions {
    std::filesystem::path checkpoint;  // empty: none is written; the caller removes it once the edit is saved
    bool resume = false;               // go on from it if it exists
    std::filesystem::path preview;     // a PNG that is written again and again; empty: none
    double checkpoint_seconds = 30, preview_seconds = 5;
};

struct EditReport {
    int iterations = 0, skipped = 0, roll_backs = 0;
    double seconds = 0, seconds_per_iteration = 0, field_seconds_per_iteration = 0;
    double first_loss = 0, loss = 0;             // means over the first and the last tenth of the iterations
    double region_share = 0, support_share = 0;  // of the object's pixels; of the box
    double added = 0, removed = 0, changed = 0;  // means of the maps over the region, after truncation
    Json to_json() const;
};

struct EditResult {
    EditFile edit;
    EditReport report;
    EditRegion region;
};

// Throws InputError for a specification or inputs that cannot work, Cancelled after saving when asked to stop, Failure
// when steps stay bad.
EditResult train_edit(const EditInputs& inputs, const EditSpec& spec, const EditRunOptions& options,
                      const Reporter& reporter);

}  // namespace fieldgraft
