// The picture shown while an edit trains: original | edit | map, side by side, over white.
//
// In the map red is what was removed, green added, blue changed; black means untouched. Written to a temporary name,
// then renamed, so that a viewer never sees half a picture.
#pragma once

#include <filesystem>

#include "core/edit/edit_render.h"

namespace fieldgraft {

// S×3S×3.
Tensor preview_picture(const EditField& edit, const FrozenPatch& patch, const EditPlan& plan,
                       const BlendOptions& options);
void write_preview(const std::filesystem::path& path, const EditField& edit, const FrozenPatch& patch,
                   const EditPlan& plan, const BlendOptions& options);

}  // namespace fieldgraft
