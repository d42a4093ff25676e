// fieldgraft info FILE…: what a field or edit file is.
#include <cstdio>
#include <memory>

#include "core/app/console.h"
#include "core/base/errors.h"
#include "core/base/safetensors.h"
#include "core/field/edit_field.h"
#include "core/field/radiance_field.h"

namespace fieldgraft::app {
namespace {

Json describe_field(const std::string& path) {
    const auto field = RadianceField::load(path);
    std::int64_t numbers = 0;
    for (const auto& [name, tensor] : field->parameters()) numbers += tensor.numel();
    return {{"path", path},
            {"kind", "field"},
            {"hash", field->hash()},
            {"parameters", numbers},
            {"config", field->config().to_json()},
            {"geometry", field->geometry().to_json()}};
}

Json describe_edit(const std::string& path) {
    const EditFile edit = EditFile::load(path);
    return {{"path", path},
            {"kind", "edit"},
            {"hash", edit.hash()},
            {"operations", edit.field->config().operations.to_string()},
            {"field_hash", edit.field_hash},
            {"stack", edit.stack},
            {"specification", edit.specification}};
}

Json describe(const std::string& path) {
    const SafeTensors file = load_safetensors(path);
    const auto found = file.metadata.find("format");
    const std::string format = found == file.metadata.end() ? "" : found->second;
    if (format == "fieldgraft.field") return describe_field(path);
    if (format == "fieldgraft.edit") return describe_edit(path);
    input_error("{}: its format is \"{}\", neither a field nor an edit; `fieldgraft train` and `edit` write them", path,
                format);
}

void print_for_people(const Json& file) {
    std::printf("%s: %s\n", file["path"].get<std::string>().c_str(), file["kind"].get<std::string>().c_str());
    for (const auto& [key, value] : file.items())
        if (key != "path" && key != "kind") std::printf("    %-14s %s\n", key.c_str(), value.dump().c_str());
}

}  // namespace

void add_info(Program& program) {
    struct Options {
        std::vector<std::string> files;
    };
    auto options = std::make_shared<Options>();
    CLI::App* app = program.command("info", "say what field and edit files are");
    app->add_option("FILE", options->files, "fields and edits")->required();
    app->callback([&program, options] {
        program.action = [&program, options] {
            Json files = Json::array();
            for (const std::string& path : options->files) files.push_back(describe(path));
            if (program.common.json) return print_done(program.common, {{"files", files}});
            for (const Json& file : files) print_for_people(file);
        };
    });
}

}  // namespace fieldgraft::app
