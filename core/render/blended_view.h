// Pictures of a field under a stack of edits.
//
// Colours are premultiplied and carry no background (over_background_color adds it). Maps are those of math in blend.h.
// **No edit, bit for bit**: render_blended_rays draws every ray through render_rays (f's own code path) and then draws
// again, blended, only those rays that have a sample in a cell where an edit acts; with no active edit there are none.
// Each level of the stack sees those below as one medium (medium.h); a level's maps are taken before the edits above
// it.
#pragma once

#include "core/render/medium.h"
#include "core/render/render_view.h"

namespace fieldgraft {

struct BlendedOptions {
    RenderOptions render;  // without jitter
    BlendOptions blend;
    SampleColor color;  // none: f's own colour
};

struct BlendedRays {
    Tensor color, alpha, depth;      // R×3, R, R
    Tensor color_edit, alpha_edit;   // R×3, R: what the topmost active edit contributes
    Tensor added, removed, changed;  // R: the topmost active edit's maps; 0 for operations it lacks
    Tensor edited;                   // R: all maps of all edits summed, at most 1
};
BlendedRays render_blended_rays(const RadianceField& field, const EditStack& stack, const RayBundle& rays,
                                const BlendedOptions& options = {});
// The same as H×W×3 and H×W; `rays` are all rays of the view, row by row.
BlendedRays render_blended_view(const RadianceField& field, const EditStack& stack, const RayBundle& rays, int height,
                                int width, const BlendedOptions& options = {});

// R bool: the rays with a sample in a cell where an active edit acts.
Tensor touched_rays(const RadianceField& field, const EditStack& stack, const RayBundle& rays,
                    const MarchOptions& options);

}  // namespace fieldgraft
