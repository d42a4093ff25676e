#include "core/base/errors.h"
#include "core/field/edit_field.h"
#include "core/field/file_parts.h"

namespace fieldgraft {
namespace {

constexpr const char* edit_format = "fieldgraft.edit";

std::vector<std::string> read_stack(const SafeTensors& file) {
    const Json json = metadata_json(file, "stack");
    std::vector<std::string> stack;
    if (!json.is_array()) input_error("{}: \"stack\" in its metadata must be a list of hashes", file.origin);
    for (const Json& item : json) {
        if (!item.is_string()) input_error("{}: \"stack\" in its metadata must be a list of hashes", file.origin);
        stack.push_back(item.get<std::string>());
    }
    return stack;
}

float read_strength(const SafeTensors& file, const Json& strengths, const char* key) {
    const auto found = strengths.is_object() ? strengths.find(key) : strengths.end();
    const bool number = found != strengths.end() && found->is_number();
    const double value = number ? found->get<double>() : -1;
    if (!(value >= 0 && value <= 1)) input_error("{}: strength \"{}\" must lie in [0, 1]", file.origin, key);
    return static_cast<float>(value);
}

}  // namespace

std::string EditFile::hash() const {
    std::map<std::string, Tensor> all = field->tensors();
    std::string text = field->geometry().to_json().dump() + field->config().to_json().dump();
    all["geometry"] = at::from_blob(text.data(), {static_cast<std::int64_t>(text.size())}, at::kByte).clone();
    return content_hash(all);
}

void EditFile::save(const std::filesystem::path& path) const {
    if (!field || !field->support().defined()) {
        throw std::invalid_argument("an edit is saved with its support: set_support() first");
    }
    const Json strengths{{"add", strength_add}, {"remove", strength_remove}, {"change", strength_change}};
    save_finite_safetensors(path, field->tensors(),
                            {{"format", edit_format},
                             {"version", "1"},
                             {"config", field->config().to_json().dump()},
                             {"geometry", field->geometry().to_json().dump()},
                             {"field_hash", field_hash},
                             {"stack", Json(stack).dump()},
                             {"specification", specification.dump()},
                             {"strengths", strengths.dump()}});
}

EditFile EditFile::load(const std::filesystem::path& path) {
    const SafeTensors file = load_safetensors(path);
    check_format(file, edit_format, "an edit");
    try {
        EditFile edit;
        edit.field = std::make_shared<EditField>(EditFieldConfig::from_json(metadata_json(file, "config")),
                                                 FieldGeometry::from_json(metadata_json(file, "geometry")), 0);
        for (auto& [name, parameter] : edit.field->parameters_) parameter = parameter_at(file, name, parameter.sizes());
        edit.field->set_support(file.at("support").clone());
        edit.field_hash = metadata_at(file, "field_hash");
        edit.stack = read_stack(file);
        edit.specification = metadata_json(file, "specification");
        const Json strengths = metadata_json(file, "strengths");
        edit.strength_add = read_strength(file, strengths, "add");
        edit.strength_remove = read_strength(file, strengths, "remove");
        edit.strength_change = read_strength(file, strengths, "change");
        return edit;
    } catch (const InputError& error) {
        const std::string message = error.what();
        if (message.find(file.origin) != std::string::npos) throw;
        throw InputError(file.origin + ": " + message);
    } catch (const std::invalid_argument& error) {
        throw InputError(file.origin + ": " + error.what());
    }
}

void EditFile::check_field(const std::string& other, const std::string& where) const {
    if (other == field_hash) return;
    input_error("{}: this edit belongs to another field (it was made for {:.12}…, the field given is {:.12}…)", where,
                field_hash, other);
}

std::string EditFile::check_stack(const std::vector<std::string>& below, const std::string& where) const {
    if (below == stack) return "";
    return fmt::format("{}: this edit was trained over {} edit{} and now lies over {}{}: it may look different", where,
                       stack.size(), stack.size() == 1 ? "" : "s", below.size(),
                       below.size() == stack.size() ? " others" : "");
}

}  // namespace fieldgraft
