#include "core/field/radiance_field.h"

#include <cmath>

#include "core/base/errors.h"
#include "core/base/random.h"
#include "core/base/shape.h"
#include "core/field/file_parts.h"
#include "core/field/hash_network.h"
#include "core/kernels/field_mlp_simd.h"

namespace fieldgraft {
namespace {

constexpr const char* field_format = "fieldgraft.field";
constexpr const char* occupancy_name = "occupancy";

std::map<std::string, std::vector<std::int64_t>> parameter_shapes(const HashFieldConfig& config, const HashGrid& grid) {
    const std::int64_t basis = config.sh_degree * config.sh_degree;
    return {{"encoding.table", {static_cast<std::int64_t>(grid.entries), config.features_per_level}},
            {"density.0", {config.density_hidden, static_cast<std::int64_t>(grid.rows())}},
            {"density.1", {config.feature_size, config.density_hidden}},
            {"color.0", {config.color_hidden, basis + config.feature_size}},
            {"color.1", {config.color_hidden, config.color_hidden}},
            {"color.2", {3, config.color_hidden}}};
}

// Uniform in ±limit: 1e-4 for the table (Müller et al. 2022), He's bound for a matrix in front of a ReLU.
Tensor initial_parameter(const std::string& name, const std::vector<std::int64_t>& shape, std::uint64_t seed,
                         std::uint64_t sequence) {
    const bool table = name == "encoding.table", last = name == "density.1" || name == "color.2";
    const float limit = table ? 1e-4f : std::sqrt((last ? 3.0f : 6.0f) / static_cast<float>(shape[1]));
    Tensor parameter = at::empty(shape, at::kFloat);
    Random random(seed, sequence);
    float* values = parameter.mutable_data_ptr<float>();
    for (std::int64_t i = 0; i < parameter.numel(); ++i) values[i] = random.uniform(-limit, limit);
    return parameter;
}

HashNetwork make_network(const HashFieldConfig& config, const FieldGeometry& geometry) {
    return {make_hash_grid(config.levels, config.features_per_level, config.log2_table_size, config.base_resolution,
                           config.finest_resolution),
            geometry.box_min, geometry.box_max, config.sh_degree};
}

int read_count(const Json& json, const char* key, int low, int high) {
    const auto found = json.find(key);
    if (found == json.end() || !found->is_number_integer()) input_error("field: \"{}\" must be a whole number", key);
    const std::int64_t value = found->get<std::int64_t>();
    if (value < low || value > high) input_error("field: \"{}\" must be {} to {}, not {}", key, low, high, value);
    return static_cast<int>(value);
}

void check_occupancy(const Tensor& occupancy) {
    if (!occupancy.defined()) return;
    const bool cube = occupancy.dim() == 3 && occupancy.size(0) == occupancy.size(1) &&
                      occupancy.size(1) == occupancy.size(2) && occupancy.size(0) > 0;
    if (!cube || occupancy.scalar_type() != at::kByte) {
        throw std::invalid_argument("occupancy must be a cube of bytes, not " + shape_text(occupancy));
    }
}

}  // namespace

Json HashFieldConfig::to_json() const {
    return {{"backbone", "hash"},
            {"levels", levels},
            {"features_per_level", features_per_level},
            {"log2_table_size", log2_table_size},
            {"base_resolution", base_resolution},
            {"finest_resolution", finest_resolution},
            {"density_hidden", density_hidden},
            {"feature_size", feature_size},
            {"color_hidden", color_hidden},
            {"sh_degree", sh_degree}};
}

HashFieldConfig HashFieldConfig::from_json(const Json& json) {
    if (!json.is_object()) input_error("field: the configuration must be a JSON object");
    const std::string backbone = json.value("backbone", Json()).is_string() ? json["backbone"].get<std::string>() : "";
    if (backbone != "hash")
        input_error("field: backbone \"{}\" is unknown; \"hash\" is what this version reads", backbone);
    HashFieldConfig config;
    config.levels = read_count(json, "levels", 1, 64);
    config.features_per_level = read_count(json, "features_per_level", 1, 8);
    config.log2_table_size = read_count(json, "log2_table_size", 1, 28);
    config.finest_resolution = read_count(json, "finest_resolution", 1, 1 << 20);
    config.base_resolution = read_count(json, "base_resolution", 1, config.finest_resolution);
    config.density_hidden = read_count(json, "density_hidden", 1, 1024);
    config.feature_size = read_count(json, "feature_size", 1, 1024);
    config.color_hidden = read_count(json, "color_hidden", 1, 1024);
    config.sh_degree = read_count(json, "sh_degree", 1, 4);
    return config;
}

RadianceField::RadianceField(const HashFieldConfig& config, const FieldGeometry& geometry, std::uint64_t seed)
    : config_(HashFieldConfig::from_json(config.to_json())),
      geometry_(FieldGeometry::from_json(geometry.to_json())),
      network_(std::make_shared<HashNetwork>(make_network(config, geometry))) {
    std::uint64_t sequence = 0;
    for (const auto& [name, shape] : parameter_shapes(config_, network_->grid)) {
        parameters_[name] = initial_parameter(name, shape, seed, ++sequence).requires_grad_(true);
    }
}

FieldMlpShape RadianceField::mlp_shape() const {
    return {static_cast<int>(network_->grid.rows()), config_.density_hidden, config_.feature_size,
            config_.sh_degree * config_.sh_degree, config_.color_hidden};
}

RadianceField::DensityOut RadianceField::density(const Tensor& positions) const {
    DensityFeatures out = hash_density(network_, positions, parameters_.at("encoding.table"),
                                       {parameters_.at("density.0"), parameters_.at("density.1")});
    return {out.density, out.features};
}

Tensor RadianceField::color(const Tensor& features, const Tensor& directions) const {
    return hash_color(config_.sh_degree, features, directions,
                      {parameters_.at("color.0"), parameters_.at("color.1"), parameters_.at("color.2")});
}

void RadianceField::set_occupancy(Tensor occupancy) {
    check_occupancy(occupancy);
    occupancy_ = occupancy.defined() ? occupancy.contiguous() : occupancy;
}

void RadianceField::freeze() {
    for (auto& [name, parameter] : parameters_) parameter.requires_grad_(false);
}

std::map<std::string, Tensor> RadianceField::tensors() const {
    std::map<std::string, Tensor> all;
    for (const auto& [name, parameter] : parameters_) all[name] = parameter.detach();
    if (occupancy_.defined()) all[occupancy_name] = occupancy_;
    return all;
}

std::string RadianceField::hash() const {
    // Where the field lies and how its tensors are read is as much a part of it as the tensors.
    std::map<std::string, Tensor> all = tensors();
    std::string text = geometry_.to_json().dump() + config_.to_json().dump();
    all["geometry"] = at::from_blob(text.data(), {static_cast<std::int64_t>(text.size())}, at::kByte).clone();
    return content_hash(all);
}

void RadianceField::save(const std::filesystem::path& path, const Json& extra_metadata) const {
    save_finite_safetensors(path, tensors(),
                            {{"format", field_format},
                             {"version", "1"},
                             {"config", config_.to_json().dump()},
                             {"geometry", geometry_.to_json().dump()},
                             {"extra", extra_metadata.dump()}});
}

std::shared_ptr<RadianceField> RadianceField::load(const std::filesystem::path& path) {
    const SafeTensors file = load_safetensors(path);
    check_format(file, field_format, "a field");
    try {
        const auto config = HashFieldConfig::from_json(metadata_json(file, "config"));
        const auto geometry = FieldGeometry::from_json(metadata_json(file, "geometry"));
        auto field = std::shared_ptr<RadianceField>(new RadianceField(config, geometry));
        for (const auto& [name, shape] : parameter_shapes(config, field->network_->grid)) {
            field->parameters_[name] = parameter_at(file, name, shape);
        }
        if (file.tensors.contains(occupancy_name)) field->set_occupancy(file.at(occupancy_name).clone());
        return field;
    } catch (const InputError& error) {
        const std::string message = error.what();
        if (message.find(file.origin) != std::string::npos) throw;
        throw InputError(file.origin + ": " + message);
    } catch (const std::invalid_argument& error) {
        throw InputError(file.origin + ": " + error.what());
    }
}

RadianceField::RadianceField(const HashFieldConfig& config, const FieldGeometry& geometry)
    : config_(config), geometry_(geometry), network_(std::make_shared<HashNetwork>(make_network(config, geometry))) {}

}  // namespace fieldgraft
