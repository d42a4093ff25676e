// What several subcommands read from the command line: a field, a stack of edits with strengths, cameras to render
// from.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/base/progress.h"
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
// files[0] is the field, the rest are edits over it. Another field's edit throws InputError; an edit trained over
// another stack is a warning.
FieldWithEdits load_field_and_edits(const std::vector<std::string>& files, const Reporter& reporter);

// The views of a scene's split, or those of them that are named. Throws InputError for a name that is not there, and
// for a split that has no views.
std::vector<View> select_views(const Scene& scene, const std::string& split, const std::vector<std::string>& only);

// The scene whose camera poses and pictures belong to this field; throws InputError when its frame is another one.
Scene load_scene_of(const RadianceField& field, const std::string& path, const std::vector<std::string>& splits,
                    const Reporter& reporter);

struct NamedFile {
    std::string view, file;
};
// VIEW:FILE; throws InputError when the colon or either side is missing.
NamedFile parse_view_file(const std::string& argument, const std::string& flag);

// The folder of a built-in model ("guide", "judge"): in $FIELDGRAFT_MODELS, or in the models/ folder of the nearest of
// the program's parent folders that has it. Throws InputError, naming what was looked at.
std::filesystem::path builtin_model(const std::string& name);

// "white" | "black" | "scene" (of the field's pictures) → 3 floats; "transparent" → an undefined tensor.
Tensor background_color(const std::string& name, const FieldGeometry& geometry);

}  // namespace fieldgraft::app
