// fieldgraft info FILE…: what a field or edit file is.
#include <cstdio>
#include <memory>

#include "core/app/console.h"
#include "core/base/errors.h"
#include "core/base/safetensors.h"
#include "core/edit/plan_cost.h"
#include "core/field/edit_field.h"
#include "core/field/radiance_field.h"
#include "core/profile/machine_rates.h"

namespace fieldgraft::app {
namespace {

// Seconds on this machine, once it has been measured: a picture of the usual size, a bake of each quality.
Json costs_of(const RadianceField& field) {
    const std::optional<MachineRates> rates = load_rates();
    if (!rates) return {};
    const FieldGeometry& g = field.geometry();
    const Vec3 eye{g.centre[0] + g.radius_range[1], g.centre[1], g.centre[2] + 0.3 * g.radius_range[1]};
    const Vec3 centre{g.centre[0], g.centre[1], g.centre[2]}, up{g.up[0], g.up[1], g.up[2]};
    const double angle = 2 * std::atan(0.5 * g.image_width / g.focal_x);
    const Camera camera = camera_from_angle(g.image_width, g.image_height, angle, look_at(eye, centre, up));
    Json costs{{"view", view_seconds(*rates, field, camera)}};
    const std::vector<int> resolutions{128, 256, 384};  // bake --quality
    const std::vector<double> bakes = bake_seconds(*rates, field, resolutions);
    for (std::size_t i = 0; i < bakes.size(); ++i) costs[fmt::format("bake_{}", resolutions[i])] = bakes[i];
    return costs;
}

Json describe_field(const std::string& path) {
    const auto field = RadianceField::load(path);
    std::int64_t numbers = 0;
    for (const auto& [name, tensor] : field->parameters()) numbers += tensor.numel();
    Json file{{"path", path},
              {"kind", "field"},
              {"hash", field->hash()},
              {"parameters", numbers},
              {"config", field->config().to_json()},
              {"geometry", field->geometry().to_json()}};
    if (const Json costs = costs_of(*field); !costs.is_null()) file["seconds"] = costs;
    return file;
}

// What runs for this edit, what that costs, and what does not run.
Json describe_plan(const EditFile& edit) {
    const EditSpec spec = EditSpec::from_json(edit.specification);
    const EditPlan plan = EditPlan::compile(spec);
    Json json = plan.to_json(), skipped = Json::array();
    for (const auto& [what, why] : left_out(spec, plan)) skipped.push_back({{"what", what}, {"why", why}});
    json["cost"] = cost_of(edit.field->config(), plan).to_json();
    json["left_out"] = skipped;
    return json;
}

Json describe_edit(const std::string& path) {
    const EditFile edit = EditFile::load(path);
    const Tensor& support = edit.field->support();
    Json file{{"path", path},
              {"kind", "edit"},
              {"hash", edit.hash()},
              {"operations", edit.field->config().operations.to_string()},
              {"field_hash", edit.field_hash},
              {"stack", edit.stack},
              {"support_share", support.ne(0).to(at::kFloat).mean().item<double>()},
              {"specification", edit.specification}};
    // An edit that was not trained here says nothing of how.
    if (!edit.specification.empty()) file["plan"] = describe_plan(edit);
    return file;
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

void print_plan(const Json& plan) {
    std::printf("    what runs\n");
    for (const auto& [key, value] : plan.items())
        if (key != "cost" && key != "left_out") std::printf("        %-20s %s\n", key.c_str(), value.dump().c_str());
    std::printf("    what it costs\n");
    for (const auto& [key, value] : plan["cost"].items())
        std::printf("        %-20s %s\n", key.c_str(), value.dump().c_str());
    std::printf("    what is left out\n");
    for (const Json& item : plan["left_out"])
        std::printf("        %s: %s\n", item["what"].get<std::string>().c_str(),
                    item["why"].get<std::string>().c_str());
}

void print_for_people(const Json& file) {
    std::printf("%s: %s\n", file["path"].get<std::string>().c_str(), file["kind"].get<std::string>().c_str());
    for (const auto& [key, value] : file.items()) {
        if (key == "plan") {
            print_plan(value);
        } else if (key != "path" && key != "kind") {
            std::printf("    %-14s %s\n", key.c_str(), value.dump().c_str());
        }
    }
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
