// Pictures of a field with edits, as `render` and `eval` make them.
#pragma once

#include "core/app/console.h"
#include "core/app/inputs.h"
#include "core/render/blended_view.h"

namespace fieldgraft::app {

// --background, --compositing and what else a picture depends on.
struct PictureOptions {
    std::string background = "scene", compositing = "paper", color = "view";
    // draft, preview or final: points of the front in docs/accuracy-and-time.md, the first two for about half the time.
    std::string quality = "final";
    double scale = 1;
};
void add_picture_flags(CLI::App* app, PictureOptions& options);
BlendedOptions blended_options(const RadianceField& field, const PictureOptions& options);

struct Picture {
    Tensor color;                           // H×W×3, premultiplied, no background
    Tensor alpha, added, removed, changed;  // H×W
};
Picture draw_picture(const FieldWithEdits& scene, const Camera& camera, const PictureOptions& options);
// H×W×3 over a colour (background_color, inputs.h), or H×W×4 with straight alpha if it is undefined; not clamped.
Tensor with_background(const Picture& picture, const Tensor& background);

}  // namespace fieldgraft::app
