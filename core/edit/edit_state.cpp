#include "core/edit/edit_state.h"

#include "core/base/errors.h"
#include "core/base/safetensors.h"

namespace fieldgraft {

namespace {

constexpr const char* format_name = "fieldgraft edit checkpoint 2";

Json to_json(const EditState& state) {
    // 64-bit states as text: JSON readers may pass numbers through doubles.
    return {{"iteration", state.iteration},
            {"seconds", state.seconds},
            {"tower_seconds", state.tower_seconds},
            {"random_state", std::to_string(state.random.state())},
            {"random_increment", std::to_string(state.random.increment())},
            {"guard", state.guard.to_json()}};
}

EditState from_json(const Json& json) {
    EditState state;
    state.iteration = json.at("iteration").get<int>();
    state.seconds = json.at("seconds").get<double>();
    state.tower_seconds = json.at("tower_seconds").get<double>();
    state.random.restore(std::stoull(json.at("random_state").get<std::string>()),
                         std::stoull(json.at("random_increment").get<std::string>()));
    state.guard = GuardState::from_json(json.at("guard"));
    return state;
}

}  // namespace

std::map<std::string, Tensor> learnt(const EditField& field, const Adam& adam) {
    std::map<std::string, Tensor> tensors;
    for (const auto& [name, parameter] : field.parameters()) tensors["p." + name] = parameter.detach();
    for (const auto& [name, moment] : adam.state()) tensors["adam." + name] = moment;
    return tensors;
}

void put_back(const std::map<std::string, Tensor>& tensors, EditField& field, Adam& adam) {
    at::NoGradGuard no_gradients;
    for (const auto& [name, parameter] : field.parameters()) {
        const auto found = tensors.find("p." + name);
        if (found == tensors.end() || found->second.sizes() != parameter.sizes())
            input_error("checkpoint: \"{}\" is missing or has another shape; it belongs to another edit", name);
        Tensor(parameter).copy_(found->second);
    }
    std::map<std::string, Tensor> moments;
    for (const auto& [name, tensor] : tensors)
        if (name.starts_with("adam.")) moments[name.substr(5)] = tensor;
    adam.restore(moments);
}

void save_checkpoint(const std::filesystem::path& path, const EditState& state, const EditField& field,
                     const Adam& adam, const EditRegion& region, const Json& identity) {
    std::map<std::string, Tensor> tensors = region.tensors();
    tensors.merge(learnt(field, adam));
    save_finite_safetensors(path, tensors,
                            {{"format", format_name},
                             {"state", to_json(state).dump()},
                             {"region", region.to_json().dump()},
                             {"identity", identity.dump()}});
}

Checkpoint load_checkpoint(const std::filesystem::path& path, const Json& identity) {
    SafeTensors file = load_safetensors(path);
    if (file.metadata["format"] != format_name)
        input_error("{}: not a checkpoint of an edit; start without --resume", path.string());
    if (const std::string bad = not_finite(file.tensors); !bad.empty())
        input_error("{}: \"{}\" holds numbers that are not finite; start without --resume", path.string(), bad);
    try {
        if (Json::parse(file.metadata["identity"]) != identity)
            input_error(
                "{}: the checkpoint is of another edit (prompts, settings, field or guide differ); start without "
                "--resume",
                path.string());
        const Json region = Json::parse(file.metadata["region"]);
        return {from_json(Json::parse(file.metadata["state"])), file.tensors,
                EditRegion::restore(file.tensors, region)};
    } catch (const Json::exception& error) {
        input_error("{}: the checkpoint is damaged ({}); start without --resume", path.string(), error.what());
    }
}

}  // namespace fieldgraft
