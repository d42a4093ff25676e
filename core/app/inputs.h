// What several subcommands read from the command line: a field, a stack of edits with strengths, cameras to render from.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/field/edit_field.h"
#include "core/field/radiance_field.h"
#include "core/scene/scene.h"

namespace fieldgraft::app {

// EDIT[:add=X,remove=X,change=X] → the file with its strengths set. Throws InputError for a strength outside [0, 1], an
// unknown name, or a strength for an operation that the edit does not have.
EditFile load_edit_argument(const std::string& argument);

struct FieldWithEdits {
    std::shared_ptr<RadianceField> field;
    std::vector<EditFile> edits;  // bottom of the stack first
};
// FILES[0] is the field, the rest are edits over it. Another field's edit throws InputError; an edit trained over another
// stack is a warning.
FieldWithEdits load_field_and_edits(const std::vector<std::string>& files, const Reporter& reporter);

// A view to render: its camera in model coordinates and the name its pictures get.
struct NamedCamera {
    std::string name;
    Camera camera;
};
// The views of a scene's split whose names are in `only` (all when empty). Throws InputError for a name that is not there.
std::vector<const View*> select_views(const Scene& scene, const std::string& split, const std::vector<std::string>& only);

// "VIEW:FILE" arguments → pairs; throws InputError when the colon or either side is missing.
std::vector<std::pair<std::string, std::string>> parse_view_files(const std::vector<std::string>& arguments,
                                                                  const std::string& flag);
// "white" | "black" → 3 floats; "transparent" → an undefined tensor.
Tensor background_color(const std::string& name);

}  // namespace fieldgraft::app
