// The original field f: position and direction to density and colour (frozen while it is edited).
//
// Backbone "hash" (Instant-NGP, Müller et al. 2022): multiresolution hash encoding → density MLP (one hidden layer) →
// [log density, 15 features]; spherical harmonics of the direction (degree 4, 16 values) ++ 16 outputs → colour MLP
// (two hidden layers) → sigmoid. Density is exp of the first output, clamped before exp with a gradient that stays
// finite.
//
// Shapes: positions N×3 in model coordinates (outside the box: density 0), directions N×3 unit vectors, float32.
// Differentiable in the parameters; not in positions or directions.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "core/base/torch.h"
#include "core/field/geometry.h"

namespace fieldgraft {

struct HashFieldConfig {
    int levels = 8;
    int features_per_level = 4;
    int log2_table_size = 17;
    int base_resolution = 16;
    int finest_resolution = 1024;  // cells along the box's longest edge
    int density_hidden = 64;
    int feature_size = 16;  // outputs of the density MLP, the first is log density
    int color_hidden = 64;
    int sh_degree = 4;

    Json to_json() const;
    static HashFieldConfig from_json(const Json& json);
};

struct FieldMlpShape;
struct HashNetwork;

class RadianceField {
  public:
    struct DensityOut {
        Tensor density;   // N
        Tensor features;  // N×feature_size, what color() needs
    };
    RadianceField(const HashFieldConfig& config, const FieldGeometry& geometry, std::uint64_t seed);

    DensityOut density(const Tensor& positions) const;
    Tensor color(const Tensor& features, const Tensor& directions) const;  // N×3 in [0, 1]

    const std::map<std::string, Tensor>& parameters() const { return parameters_; }  // leaves, by file name
    const HashFieldConfig& config() const { return config_; }
    const HashNetwork& network() const { return *network_; }
    // Widths of the two networks, as the kernels want them (core/kernels/field_mlp_simd.h).
    FieldMlpShape mlp_shape() const;
    const FieldGeometry& geometry() const { return geometry_; }
    // R×R×R uint8 (z, y, x order): cells of the box that may hold density; travels in the file. Undefined until
    // trained.
    const Tensor& occupancy() const { return occupancy_; }
    void set_occupancy(Tensor occupancy);
    void freeze();  // requires_grad off everywhere

    // SHA-256 over tensors and geometry; metadata does not enter. An edit stores it.
    std::string hash() const;
    // Throws Failure, and writes nothing, when a parameter is not finite.
    void save(const std::filesystem::path& path, const Json& extra_metadata = Json::object()) const;
    // Throws InputError: not a field file, another backbone, missing or misshapen tensors. What comes back is frozen.
    static std::shared_ptr<RadianceField> load(const std::filesystem::path& path);

  private:
    RadianceField(const HashFieldConfig& config, const FieldGeometry& geometry);
    std::map<std::string, Tensor> tensors() const;

    HashFieldConfig config_;
    FieldGeometry geometry_;
    std::shared_ptr<const HashNetwork> network_;
    std::map<std::string, Tensor> parameters_;
    Tensor occupancy_;
};

}  // namespace fieldgraft
