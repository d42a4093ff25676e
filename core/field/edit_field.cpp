#include "core/field/edit_field.h"

#include <cmath>
#include <sstream>

#include "core/base/errors.h"
#include "core/base/random.h"
#include "core/base/shape.h"
#include "core/field/cells.h"

namespace fieldgraft {
namespace {

constexpr float initial_feature = 0.1f;  // grid entries start uniform within ± this
constexpr double density_cells = 128;    // density_e is counted per box edge / 128

struct Head {
    const char* name;
    std::int64_t size;
    double bias;  // of z at the start
};

// z with sigmoid(8 tanh(z/8)) = value.
double bounded_bias(double value) {
    return bounded_logit * std::atanh(std::log(value / (1 - value)) / bounded_logit);
}

// The heads that the operations need, in the order in which they lie in the network's output.
std::vector<Head> heads_of(const EditFieldConfig& config) {
    const Operations& on = config.operations;
    const double beta_bias = bounded_bias(config.initial_beta);
    // softplus(z) = initial_density.
    const double density_bias = std::log(std::expm1(config.initial_density));
    std::vector<Head> heads;
    if (on.add) heads.push_back({"density_e", 1, density_bias});
    if (on.add || on.change) heads.push_back({"color_e", 3, 0});
    if (on.remove) heads.push_back({"beta_density", 1, beta_bias});
    if (on.change) heads.push_back({"beta_color", 1, beta_bias});
    return heads;
}

Tensor uniform(at::IntArrayRef shape, float limit, Random& random) {
    Tensor tensor = at::empty(shape, at::kFloat);
    float* values = tensor.mutable_data_ptr<float>();
    for (std::int64_t i = 0; i < tensor.numel(); ++i) values[i] = random.uniform(-limit, limit);
    return tensor;
}

std::map<std::string, Tensor> initial_parameters(const EditFieldConfig& config, const HashGrid& grid,
                                                 std::uint64_t seed) {
    const std::int64_t rows = static_cast<std::int64_t>(grid.rows()), hidden = config.hidden;
    std::map<std::string, Tensor> parameters;
    Random table_random(seed, 1), hidden_random(seed, 2), head_random(seed, 3);
    parameters["grid.table"] =
        uniform({static_cast<std::int64_t>(grid.entries), grid.features}, initial_feature, table_random);
    parameters["hidden.weight"] = uniform({hidden, rows}, std::sqrt(6.0f / rows), hidden_random);
    parameters["hidden.bias"] = uniform({hidden}, 0.25f, hidden_random);
    for (const Head& head : heads_of(config)) {  // small weights: the biases decide how g starts
        parameters[std::string(head.name) + ".weight"] =
            uniform({head.size, hidden}, 0.2f * std::sqrt(3.0f / hidden), head_random);
        parameters[std::string(head.name) + ".bias"] = at::full({head.size}, head.bias, at::kFloat);
    }
    for (auto& [name, parameter] : parameters) parameter.requires_grad_(true);
    return parameters;
}

int read_int(const Json& json, const char* key, int low, int high) {
    const auto found = json.find(key);
    if (found == json.end() || !found->is_number_integer()) input_error("edit: \"{}\" must be a whole number", key);
    const auto value = found->get<std::int64_t>();
    if (value < low || value > high) input_error("edit: \"{}\" must be {} to {}, not {}", key, low, high, value);
    return static_cast<int>(value);
}

double read_number(const Json& json, const char* key, double low, double high) {
    const auto found = json.find(key);
    if (found == json.end() || !found->is_number()) input_error("edit: \"{}\" must be a number", key);
    const double value = found->get<double>();
    if (!(value > low && value < high))
        input_error("edit: \"{}\" must lie between {} and {}, not {}", key, low, high, value);
    return value;
}

std::shared_ptr<const EditNetwork> network_of(const EditFieldConfig& config, const FieldGeometry& geometry) {
    auto network = std::make_shared<EditNetwork>();
    network->grid = make_level_grid(config.resolutions, config.features_per_level, config.log2_table_size);
    network->geometry = geometry;
    network->mlp.encoded = static_cast<int>(network->grid.rows());
    network->mlp.hidden = config.hidden;
    network->mlp.density_scale = static_cast<float>(density_cells / longest_edge(geometry));
    for (const Head& head : heads_of(config)) {
        const bool density = std::string(head.name) == "density_e";
        network->heads.push_back(static_cast<int>(head.size));
        network->mlp.outputs.insert(network->mlp.outputs.end(), head.size,
                                    density ? EditActivation::softplus : EditActivation::bounded);
    }
    return network;
}

}  // namespace

Operations Operations::parse(const std::string& list) {
    Operations operations;
    std::istringstream stream(list);
    for (std::string word; std::getline(stream, word, ',');) {
        word.erase(0, word.find_first_not_of(" \t"));
        word.erase(word.find_last_not_of(" \t") + 1);
        if (word == "add")
            operations.add = true;
        else if (word == "remove")
            operations.remove = true;
        else if (word == "change")
            operations.change = true;
        else
            input_error("operation \"{}\" is unknown; a comma-separated list of add, remove, change is needed", word);
    }
    if (!operations.any()) input_error("no operation given: a comma-separated list of add, remove, change is needed");
    return operations;
}

std::string Operations::to_string() const {
    std::string list;
    for (const auto& [on, word] : {std::pair{change, "change"}, {add, "add"}, {remove, "remove"}}) {
        if (!on) continue;
        if (!list.empty()) list += ',';
        list += word;
    }
    return list;
}

Json EditFieldConfig::to_json() const {
    return {{"operations", operations.to_string()},
            {"resolutions", resolutions},
            {"features_per_level", features_per_level},
            {"log2_table_size", log2_table_size},
            {"hidden", hidden},
            {"initial_beta", initial_beta},
            {"initial_density", initial_density}};
}

EditFieldConfig EditFieldConfig::from_json(const Json& json) {
    if (!json.is_object()) input_error("edit: the configuration must be a JSON object");
    EditFieldConfig config;
    const auto operations = json.find("operations"), resolutions = json.find("resolutions");
    if (operations == json.end() || !operations->is_string()) input_error("edit: \"operations\" must be a string");
    config.operations = Operations::parse(operations->get<std::string>());
    if (resolutions == json.end() || !resolutions->is_array() || resolutions->empty() || resolutions->size() > 32) {
        input_error("edit: \"resolutions\" must be a list of 1 to 32 whole numbers");
    }
    config.resolutions.clear();
    for (const Json& item : *resolutions)
        config.resolutions.push_back(read_int({{"resolutions", item}}, "resolutions", 1, 4096));
    config.features_per_level = read_int(json, "features_per_level", 1, 8);
    config.log2_table_size = read_int(json, "log2_table_size", 1, 28);
    config.hidden = read_int(json, "hidden", 1, 1024);
    // sigmoid's logit must lie within the bound.
    config.initial_beta = read_number(json, "initial_beta", 3.4e-4, 1 - 3.4e-4);
    config.initial_density = read_number(json, "initial_density", 0, 100);
    return config;
}

EditField::EditField(const EditFieldConfig& config, const FieldGeometry& geometry, std::uint64_t seed)
    : config_(EditFieldConfig::from_json(config.to_json())),
      geometry_(FieldGeometry::from_json(geometry.to_json())),
      network_(network_of(config_, geometry_)),
      parameters_(initial_parameters(config_, network_->grid, seed)),
      level_weights_(config.resolutions.size(), 1.0f) {}

EditSamples EditField::evaluate(const Tensor& positions) const {
    return evaluate(positions, at::arange(positions.size(0), at::kLong));
}

EditSamples EditField::evaluate(const Tensor& positions, const Tensor& index) const {
    const bool all = index.size(0) == positions.size(0);
    const Tensor inside = in_cells(geometry_, support_, all ? positions : positions.index_select(0, index));
    const Tensor asked = inside.all().item<bool>() ? index : index.masked_select(inside);
    const EditMatrices m = matrices();
    const std::vector<Tensor> values = edit_network(network_, positions, asked, m.table, m.hidden_weight, m.hidden_bias,
                                                    m.output_weight, m.output_bias);
    const std::vector<Head> heads = heads_of(config_);
    EditSamples out;
    for (std::size_t i = 0; i < heads.size(); ++i) {
        const std::string name = heads[i].name;
        (name == "density_e"      ? out.density_e
         : name == "color_e"      ? out.color_e
         : name == "beta_density" ? out.beta_density
                                  : out.beta_color) = values[i];
    }
    return out;
}

EditMatrices EditField::matrices() const {
    Tensor hidden_weight = parameters_.at("hidden.weight");
    if (std::any_of(level_weights_.begin(), level_weights_.end(), [](float w) { return w != 1; }))
        hidden_weight = hidden_weight * torch::tensor(level_weights_).repeat_interleave(config_.features_per_level);
    std::vector<Tensor> weights, biases;
    for (const Head& head : heads_of(config_)) {
        weights.push_back(parameters_.at(std::string(head.name) + ".weight"));
        biases.push_back(parameters_.at(std::string(head.name) + ".bias"));
    }
    return {parameters_.at("grid.table"), hidden_weight, parameters_.at("hidden.bias"), at::cat(weights),
            at::cat(biases)};
}

void EditField::set_first_color(const std::array<float, 3>& color) {
    const auto bias = parameters_.find("color_e.bias");
    if (bias == parameters_.end()) throw std::logic_error("the edit has no colour of its own");
    at::NoGradGuard no_grad;
    for (int c = 0; c < 3; ++c) bias->second[c].fill_(bounded_bias(color[c]));
}

void EditField::set_level_weights(std::vector<float> weights) {
    if (weights.size() != config_.resolutions.size()) {
        throw std::invalid_argument(
            fmt::format("{} level weights for {} levels", weights.size(), config_.resolutions.size()));
    }
    for (const float w : weights) {
        if (!(w >= 0 && w <= 1))
            throw std::invalid_argument(fmt::format("a level weight must lie in [0, 1], not {}", w));
    }
    level_weights_ = std::move(weights);
}

void EditField::set_support(Tensor support) {
    if (support.defined()) check_cells(support, "an edit's support");
    support_ = support.defined() ? support.contiguous() : support;
}

std::map<std::string, Tensor> EditField::tensors() const {
    std::map<std::string, Tensor> all;
    for (const auto& [name, parameter] : parameters_) all[name] = parameter.detach().clone();
    for (std::size_t l = 0; l < level_weights_.size(); ++l) {
        const HashGridLevel& level = network_->grid.levels[l];
        if (level_weights_[l] == 1) continue;
        all["grid.table"].narrow(0, static_cast<std::int64_t>(level.offset), level.entries).mul_(level_weights_[l]);
    }
    if (support_.defined()) all["support"] = support_.clone();
    return all;
}

}  // namespace fieldgraft
