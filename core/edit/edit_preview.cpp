#include "core/edit/edit_preview.h"

#include "core/base/image.h"

namespace fieldgraft {

Tensor preview_picture(const EditField& edit, const FrozenPatch& patch, const EditPlan& plan,
                       const BlendOptions& options) {
    at::NoGradGuard no_gradients;
    const Tensor white = at::ones({3});
    const RenderedEdit rendered = render_edit(edit, patch, plan, options, white);
    const auto channel = [&](const Tensor& map) { return map.defined() ? map : at::zeros({patch.size, patch.size}); };
    const Tensor maps = at::stack({channel(rendered.removed), channel(rendered.added), channel(rendered.changed)}, 2);
    return at::cat({patch.over(white), rendered.blended, maps}, 1).clamp(0, 1);
}

void write_preview(const std::filesystem::path& path, const EditField& edit, const FrozenPatch& patch,
                   const EditPlan& plan, const BlendOptions& options) {
    write_png(path, preview_picture(edit, patch, plan, options));
}

}  // namespace fieldgraft
