// What an edit is: prompts, operations, thresholds, region, losses and schedule, as the user states them.
//
// An EditSpec starts as a preset and is changed by what the user names. It travels as JSON inside the edit's file.
//   paper-mlp, paper-hash   the published settings (Blending-NeRF, sec. 5.1 and appendices A, B, F)
//   builtin                 for the small built-in guide: directional loss first, a smooth coarse g, one region fused
//   in 3D
// Thresholds τ are shares of the frame (paper) or of the region's area (builtin). `dilation` counts 5×5 dilations at
// 352×352 pixels; at other sizes the radius is scaled. Schedules (learning rate, thresholds, levels) are in iterations
// of `nominal_iterations`; an edit run for fewer iterations or for minutes goes through the same schedule faster.
#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "core/field/edit_field.h"
#include "core/render/blend.h"

namespace fieldgraft {

enum class RegionSource {
    segmenter,
    masks,
    both
};                                        // masks: --mask-only; both: masks outvote the segmenter where they see
enum class RegionFusion { fused, view };  // one vote grid in 3D, or the paper's own mask per view
enum class Placement { automatic, around, above };   // where `add` may put density: round the region, or on top of it
enum class EditBackground { white, black, random };  // behind Iᵒ, Iᵉ and Iᵝ while training

struct UserMask {
    std::string view;  // a view of the scene, by name
    std::string file;  // white (> ½) where the region is
};

struct Thresholds {
    double add = 0.35, remove = 0.05, change = 0.2;
    double add_start = 0.8, change_start = 0.5;  // annealed linearly over `anneal_iterations`
    int anneal_iterations = 100;
    bool relative_to_region = false;
};

struct EditSpec {
    std::string preset;
    std::string source, target;
    std::string region_text;  // what the segmenter looks for; empty: `source`
    Operations operations;

    Thresholds tau;
    int dilation = -1;  // N_f; −1: the paper's, 10 with add, else 3
    RegionSource region_source = RegionSource::segmenter;
    RegionFusion region_fusion = RegionFusion::fused;
    Placement placement = Placement::automatic;
    bool addition_alone = false;  // Iᵉ is compared with what `target` adds, not with all of it (edit_text)
    bool confine = true;  // g is exactly 0 outside the dilated region, already while training (fused regions only)
    int region_views = 20;
    std::vector<UserMask> masks;

    std::map<std::string, double> weights;  // every known name is present, see known_weights()
    int reg_from = 0;                       // the iteration from which the entropy term counts

    int patch = 72;
    int augmentations = 24;
    std::array<double, 2> zoom{1.0, 1.0};  // focal length times U(zoom)
    int camera_pool = 0;                   // training views that are kept and seen again; 0: a new one every iteration
    EditBackground background = EditBackground::white;
    Compositing compositing = Compositing::paper;
    RemovedMap removed = RemovedMap::paper;

    std::vector<int> resolutions{8, 16, 32};  // g's grids
    bool seek_first_color = false;            // g starts in the colour of a palette that the guide likes best
    double fade_levels = 0;                   // share of the schedule over which the finer levels fade in
    double learning_rate = 1e-3, learning_rate_end = 1e-4;
    int learning_rate_iterations = 1000;
    int nominal_iterations = 2000;  // of quality "final"
    int iterations = 0;             // > 0: exactly so many
    double minutes = 0;             // > 0: so long
    std::string quality = "preview";
    std::uint64_t seed = 0;

    // A preset with everything filled in but prompts and operations; InputError names the known presets. The paper's
    // number of iterations depends on the operations.
    static EditSpec from_preset(const std::string& name, const Operations& operations);
    static const std::vector<std::string>& known_presets();
    // dir (L_dir), global (L_global of Iᵝ), global_edit (of Iᵉ), region, inside (the part of region that fills M₊),
    // opacity, reg (entropy), smooth (jitter penalty of g).
    static const std::vector<std::string>& known_weights();

    double weight(const std::string& name) const { return weights.at(name); }
    void set_weight(const std::string& name, double value);  // InputError for an unknown name or a negative value
    const std::string& segmented_text() const { return region_text.empty() ? source : region_text; }
    // What Iᵉ is compared with: `target`, or with addition_alone what it says after "with": "bulldozer with a red ball
    // on top" gives "a red ball". Empty where it says nothing of the kind: then there is no Iᵉ.
    std::string edit_text() const;
    int dilations() const { return dilation >= 0 ? dilation : operations.add ? 10 : 3; }
    Placement resolved_placement()
        const;  // automatic: `above` when the target speaks of a hat, a crown, "on top", "above" …
    int planned_iterations() const;  // 0 when the edit runs for minutes

    // One-line InputErrors: empty prompts, source = target, no operations, S > image, values out of range.
    void validate(int image_width, int image_height) const;
    Json to_json() const;
    // Keys that are absent keep the preset's values; an unknown key is an InputError.
    static EditSpec from_json(const Json& json);
};

}  // namespace fieldgraft
