// Pictures of rays through a field under a stack of edits, without tensors or a graph on the way: what an artist sees
// each time something is moved.
//
// The result is that of sample_stack, evaluate, blend and blended_medium (medium.h, blend.h) on the same rays, up to
// rounding and to where a support ends; the tests compare them. Rays end where what no edit can take away hides the
// rest. `removed` is the `visible` map.
#pragma once

#include "core/render/blended_view.h"

namespace fieldgraft {

// items: active ones (active_items), at least one. `rays` may be any of a picture's.
BlendedRays draw_blended(const RadianceField& field, const EditStack& items, const RayBundle& rays,
                         const MarchOptions& march, Compositing compositing);

}  // namespace fieldgraft
