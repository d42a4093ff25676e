#include "core/app/inputs.h"

#include <charconv>
#include <cmath>
#include <cstdlib>
#include <sstream>

#include "core/base/errors.h"

namespace fieldgraft::app {
namespace {

float parse_strength(const std::string& text, const std::string& argument) {
    float value = -1;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !(value >= 0 && value <= 1))
        input_error("{}: strength \"{}\" is not a number from 0 to 1", argument, text);
    return value;
}

void set_strength(EditFile& edit, const std::string& item, const std::string& argument) {
    const auto equals = item.find('=');
    const std::string name = item.substr(0, equals);
    if (equals == std::string::npos || (name != "add" && name != "remove" && name != "change"))
        input_error("{}: \"{}\" is not add=X, remove=X or change=X", argument, item);
    const float value = parse_strength(item.substr(equals + 1), argument);
    const Operations& has = edit.field->config().operations;
    const bool known = name == "add" ? has.add : name == "remove" ? has.remove : has.change;
    if (!known) input_error("{}: this edit does not {}; it has the operations {}", argument, name, has.to_string());
    (name == "add" ? edit.strength_add : name == "remove" ? edit.strength_remove : edit.strength_change) = value;
}

}  // namespace

EditFile load_edit_argument(const std::string& argument) {
    // A colon belongs to the strengths only when what follows looks like them: paths may hold colons.
    const auto colon = argument.rfind(':');
    const bool strengths = colon != std::string::npos && argument.find('=', colon) != std::string::npos;
    EditFile edit = EditFile::load(strengths ? argument.substr(0, colon) : argument);
    if (!strengths) return edit;
    std::istringstream list(argument.substr(colon + 1));
    for (std::string item; std::getline(list, item, ',');) set_strength(edit, item, argument);
    return edit;
}

FieldWithEdits load_field_and_edits(const std::vector<std::string>& files, const Reporter& reporter) {
    FieldWithEdits loaded{RadianceField::load(files.front()), {}};
    const std::string field_hash = loaded.field->hash();
    std::vector<std::string> below;
    for (std::size_t i = 1; i < files.size(); ++i) {
        EditFile edit = load_edit_argument(files[i]);
        edit.check_field(field_hash, files[i]);
        const std::string warning = edit.check_stack(below, files[i]);
        if (!warning.empty()) reporter.warning(warning);
        below.push_back(edit.hash());
        loaded.edits.push_back(std::move(edit));
    }
    return loaded;
}

std::vector<View> select_views(const Scene& scene, const std::string& split, const std::vector<std::string>& only) {
    std::vector<View> views = scene.views(split);
    if (views.empty())
        input_error("{}: the scene has no views in its split \"{}\"; there are train, val and test", scene.name(),
                    split);
    if (only.empty()) return views;
    std::vector<View> chosen;
    for (const std::string& name : only) chosen.push_back(scene.view(name, split));
    return chosen;
}

Scene load_scene_of(const RadianceField& field, const std::string& path, const std::vector<std::string>& splits,
                    const Reporter& reporter) {
    SceneOptions options;
    options.splits = splits;
    Scene scene = Scene::load(path, options);
    for (const std::string& warning : scene.warnings()) reporter.warning(warning);
    const auto& ours = field.geometry().frame;
    for (std::size_t i = 0; i < ours.size(); ++i)
        if (std::abs(ours[i] - scene.frame().matrix[i]) > 1e-4 * (1 + std::abs(ours[i])))
            input_error(
                "{}: this scene's frame is not the one that the field was trained in; give the scene it was trained on",
                path);
    return scene;
}

NamedFile parse_view_file(const std::string& argument, const std::string& flag) {
    const auto colon = argument.find(':');
    if (colon == std::string::npos || colon == 0 || colon + 1 == argument.size())
        input_error("{} {}: expected VIEW:FILE, a view's name and a mask picture (white where the region is)", flag,
                    argument);
    return {argument.substr(0, colon), argument.substr(colon + 1)};
}

std::filesystem::path builtin_model(const std::string& name) {
    namespace fs = std::filesystem;
    if (const char* models = std::getenv("FIELDGRAFT_MODELS")) {
        const fs::path folder = fs::path(models) / name;
        if (fs::exists(folder / "config.json")) return folder;
        input_error("FIELDGRAFT_MODELS={}: there is no {}/config.json in it", models, name);
    }
    std::error_code ignored;
    const fs::path program = fs::read_symlink("/proc/self/exe", ignored);
    for (fs::path folder = program.parent_path(); folder.has_relative_path(); folder = folder.parent_path())
        if (fs::exists(folder / "models" / name / "config.json")) return folder / "models" / name;
    input_error("no models/{}/config.json in the folders above {}; set FIELDGRAFT_MODELS to the folder that holds {}",
                name, program.string(), name);
}

Tensor background_color(const std::string& name, const FieldGeometry& geometry) {
    if (name == "transparent") return {};
    if (name == "scene") {
        const auto& b = geometry.background;
        return torch::tensor({b[0], b[1], b[2]}, torch::kFloat);
    }
    return torch::full({3}, name == "white" ? 1.0f : 0.0f);
}

}  // namespace fieldgraft::app
