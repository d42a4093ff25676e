#include "core/train/checkpoint.h"

#include "core/base/errors.h"
#include "core/base/safetensors.h"

namespace fieldgraft {
namespace {

constexpr const char* format_name = "fieldgraft.checkpoint";
constexpr const char* occupancy_name = "occupancy.values";

// Metadata are strings; doubles go by their bits, so that a resumed run is the same run.
Json counters(const TrainState& state) {
    return {{"iteration", state.iteration},
            {"rays", state.rays},
            {"samples", state.samples},
            {"skipped", state.skipped},
            {"seconds", state.seconds},
            {"error", std::bit_cast<std::uint64_t>(state.error)},
            {"rate_scale", std::bit_cast<std::uint64_t>(state.rate_scale)},
            {"random_state", state.random.state()},
            {"random_increment", state.random.increment()},
            {"optimizer_steps", state.optimizer.steps()},
            {"occupancy_turn", state.occupancy.turn()}};
}

Json parse(const SafeTensors& file, const std::string& key) {
    const auto found = file.metadata.find(key);
    const Json json = found == file.metadata.end() ? Json() : Json::parse(found->second, nullptr, false);
    if (!json.is_object()) input_error("{}: \"{}\" is missing or damaged in its metadata", file.origin, key);
    return json;
}

SafeTensors load(const std::filesystem::path& path) {
    SafeTensors file = load_safetensors(path);
    const auto format = file.metadata.find("format");
    if (format == file.metadata.end() || format->second != format_name) {
        input_error("{}: not a training checkpoint", file.origin);
    }
    return file;
}

void check_run(const SafeTensors& file, const Json& run) {
    const Json theirs = parse(file, "run");
    for (const auto& [key, value] : run.items()) {
        if (theirs.value(key, Json()) != value) {
            input_error("{}: it belongs to another run: its {} is {}, not {}; remove it or leave out --resume",
                        file.origin, key, theirs.value(key, Json()).dump(), value.dump());
        }
    }
}

}  // namespace

void save_checkpoint(const std::filesystem::path& path, const TrainState& state, const Json& run) {
    std::map<std::string, Tensor> tensors = state.optimizer.moments();
    for (const auto& [name, parameter] : state.field->parameters()) tensors["p." + name] = parameter.detach();
    tensors[occupancy_name] = state.occupancy.values();
    save_safetensors(path, tensors,
                     {{"format", format_name}, {"run", run.dump()}, {"counters", counters(state).dump()}});
}

HashFieldConfig checkpoint_field(const std::filesystem::path& path) {
    return HashFieldConfig::from_json(parse(load(path), "run").value("config", Json()));
}

void load_checkpoint(const std::filesystem::path& path, TrainState& state, const Json& run) {
    const SafeTensors file = load(path);
    check_run(file, run);
    at::NoGradGuard no_grad;
    for (const auto& [name, parameter] : state.field->parameters()) {
        const Tensor& saved = file.at("p." + name);
        if (saved.sizes() != parameter.sizes()) input_error("{}: \"{}\" has the wrong size", file.origin, name);
        Tensor target = parameter;
        target.copy_(saved);
    }
    try {
        const Json count = parse(file, "counters");
        state.iteration = count.at("iteration").get<std::int64_t>();
        state.rays = count.at("rays").get<std::int64_t>();
        state.samples = count.at("samples").get<std::int64_t>();
        state.skipped = count.at("skipped").get<std::int64_t>();
        state.seconds = count.at("seconds").get<double>();
        state.error = std::bit_cast<double>(count.at("error").get<std::uint64_t>());
        state.rate_scale = std::bit_cast<double>(count.at("rate_scale").get<std::uint64_t>());
        state.random.restore(count.at("random_state").get<std::uint64_t>(),
                             count.at("random_increment").get<std::uint64_t>());
        state.optimizer.restore(file.tensors, count.at("optimizer_steps").get<std::int64_t>());
        state.occupancy.restore(file.at(occupancy_name), count.at("occupancy_turn").get<std::int64_t>());
    } catch (const Json::exception& error) {
        input_error("{}: its counters are damaged ({})", file.origin, error.what());
    }
}

}  // namespace fieldgraft
