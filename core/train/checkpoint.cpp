#include "core/train/checkpoint.h"

#include "core/base/errors.h"
#include "core/base/safetensors.h"

namespace fieldgraft {
namespace {

constexpr const char* format_name = "fieldgraft.checkpoint";
constexpr const char* occupancy_name = "occupancy.values";
constexpr const char* counts_name = "counts";  // steps of the optimiser, looks at the occupancy

// Metadata are strings; doubles go by their bits, so that a resumed run is the same run.
Json counters(const TrainState& state) {
    return {{"iteration", state.iteration},
            {"rays", state.rays},
            {"samples", state.samples},
            {"seconds", state.seconds},
            {"guard", state.guard.to_json()},
            {"random_state", state.random.state()},
            {"random_increment", state.random.increment()}};
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

std::map<std::string, Tensor> learnt(const TrainState& state) {
    std::map<std::string, Tensor> tensors = state.optimizer.moments();
    for (const auto& [name, parameter] : state.field->parameters()) tensors["p." + name] = parameter.detach();
    tensors[occupancy_name] = state.occupancy.values();
    tensors[counts_name] = at::tensor({state.optimizer.steps(), state.occupancy.turn()}, at::kLong);
    return tensors;
}

void put_back(TrainState& state, const std::map<std::string, Tensor>& tensors) {
    at::NoGradGuard no_grad;
    const auto take = [&](const std::string& name, at::IntArrayRef sizes) -> const Tensor& {
        const auto found = tensors.find(name);
        if (found == tensors.end() || found->second.sizes() != sizes)
            input_error("checkpoint: \"{}\" is missing or has the wrong size", name);
        return found->second;
    };
    for (const auto& [name, parameter] : state.field->parameters())
        Tensor(parameter).copy_(take("p." + name, parameter.sizes()));
    const Tensor& counts = take(counts_name, {2});
    state.optimizer.restore(tensors, counts[0].item<std::int64_t>());
    state.occupancy.restore(take(occupancy_name, state.occupancy.values().sizes()), counts[1].item<std::int64_t>());
}

void save_checkpoint(const std::filesystem::path& path, const TrainState& state, const Json& run) {
    save_finite_safetensors(path, learnt(state),
                            {{"format", format_name}, {"run", run.dump()}, {"counters", counters(state).dump()}});
}

HashFieldConfig checkpoint_field(const std::filesystem::path& path) {
    return HashFieldConfig::from_json(parse(load(path), "run").value("config", Json()));
}

void load_checkpoint(const std::filesystem::path& path, TrainState& state, const Json& run) {
    const SafeTensors file = load(path);
    check_run(file, run);
    if (const std::string bad = not_finite(file.tensors); !bad.empty())
        input_error("{}: \"{}\" holds numbers that are not finite; start without --resume", file.origin, bad);
    try {
        put_back(state, file.tensors);
    } catch (const InputError& error) {
        throw InputError(file.origin + ": " + error.what());
    }
    try {
        const Json count = parse(file, "counters");
        state.iteration = count.at("iteration").get<std::int64_t>();
        state.rays = count.at("rays").get<std::int64_t>();
        state.samples = count.at("samples").get<std::int64_t>();
        state.seconds = count.at("seconds").get<double>();
        state.guard = GuardState::from_json(count.at("guard"));
        state.random.restore(count.at("random_state").get<std::uint64_t>(),
                             count.at("random_increment").get<std::uint64_t>());
    } catch (const Json::exception& error) {
        input_error("{}: its counters are damaged ({})", file.origin, error.what());
    }
}

}  // namespace fieldgraft
