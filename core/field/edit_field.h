// The editable field g: only the heads that the edit's operations need (Blending-NeRF, sec. 4.1).
//
//   change  color_e, beta_color        remove  beta_density        add  density_e, color_e
//
// A smooth, coarse grid encoding (a few low resolutions, then finer levels that a schedule fades in) and one small MLP:
//   h = relu(W encode(x) + b)    color_e, betas = sigmoid(8 tanh(z/8))    density_e = (128/edge) softplus(z)
// with z one linear head of h each, edge the box's longest. Betas start near 0.02, density_e small with a live
// gradient. An operation that is off has no head and no parameter. g is exactly 0 outside the box and, where `support`
// is set, outside its cells (a step: not differentiable there).
//
// Shapes: positions N×3 float32 (model coordinates). Outputs N or N×3, undefined tensors for heads that are off.
// Differentiable in the parameters, not in the positions. Bits do not depend on the number of threads.
#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/base/torch.h"
#include "core/field/edit_network.h"
#include "core/field/geometry.h"

namespace fieldgraft {

struct Operations {
    bool add = false, remove = false, change = false;

    bool any() const { return add || remove || change; }
    bool operator==(const Operations&) const = default;
    // "change,add" ↔ Operations; throws InputError for an unknown or empty list.
    static Operations parse(const std::string& list);
    std::string to_string() const;
};

struct EditFieldConfig {
    Operations operations;
    std::vector<int> resolutions{8, 16, 32};  // cells along the box's longest edge, dense grids or hashed when large
    int features_per_level = 4;
    int log2_table_size = 17;
    int hidden = 64;
    double initial_beta = 0.02;
    double initial_density = 0.1;  // σᵉ · (box edge / 128) at the start: small, with a live gradient

    Json to_json() const;
    static EditFieldConfig from_json(const Json& json);
};

struct EditSamples {
    Tensor density_e;     // N, ≥ 0
    Tensor color_e;       // N×3
    Tensor beta_density;  // N
    Tensor beta_color;    // N

    Operations operations() const { return {density_e.defined(), beta_density.defined(), beta_color.defined()}; }
};

// What edit_network() takes beside positions; level weights folded in, the heads one below the other.
struct EditMatrices {
    Tensor table, hidden_weight, hidden_bias, output_weight, output_bias;
};

class EditField {
  public:
    EditField(const EditFieldConfig& config, const FieldGeometry& geometry, std::uint64_t seed);
    EditSamples evaluate(const Tensor& positions) const;
    // The same, 0 but for the samples `index` (M int64, ascending) of the N.
    EditSamples evaluate(const Tensor& positions, const Tensor& index) const;

    const EditNetwork& network() const { return *network_; }
    EditMatrices matrices() const;
    const std::map<std::string, Tensor>& parameters() const { return parameters_; }
    const EditFieldConfig& config() const { return config_; }
    const FieldGeometry& geometry() const { return geometry_; }
    // Sets the head's bias so that cᵉ starts near `color` (in (0, 1)) everywhere. Throws std::logic_error without a
    // head.
    void set_first_color(const std::array<float, 3>& color);
    // Weights 0…1 a level: how far the smoothness schedule has faded each level in (folded into the table when saved).
    void set_level_weights(std::vector<float> weights);
    const std::vector<float>& level_weights() const { return level_weights_; }
    // The parameters and the support as a file holds them: detached copies, level weights folded in.
    std::map<std::string, Tensor> tensors() const;
    // R×R×R uint8 (z, y, x): the cells where g acts. Undefined while training; fixed when saved.
    const Tensor& support() const { return support_; }
    void set_support(Tensor support);

  private:
    friend struct EditFile;

    EditFieldConfig config_;
    FieldGeometry geometry_;
    std::shared_ptr<const EditNetwork> network_;
    std::map<std::string, Tensor> parameters_;
    std::vector<float> level_weights_;
    Tensor support_;
};

// One edit as a file and as an item of a stack: g, its strengths, and the field and stack it was trained over.
struct EditFile {
    std::shared_ptr<EditField> field;
    std::string field_hash;               // RadianceField::hash() of f
    std::vector<std::string> stack;       // hashes of the edits below it when it was trained
    Json specification = Json::object();  // prompts, operations, thresholds … (core/edit's EditSpec as JSON)
    float strength_add = 1, strength_remove = 1, strength_change = 1;
    // SHA-256 over tensors, configuration and geometry; strengths and specification do not enter.
    std::string hash() const;
    // One `.safetensors`; the field must have its support (g's figures are those after truncation).
    void save(const std::filesystem::path& path) const;
    // Throws InputError: not an edit file, missing or misshapen tensors, strengths outside [0, 1].
    static EditFile load(const std::filesystem::path& path);
    // Throws InputError when `field_hash` is another field's.
    void check_field(const std::string& field_hash, const std::string& where) const;
    // A warning when the edits below (their hashes, lowest first) are not those it was trained over; else empty.
    std::string check_stack(const std::vector<std::string>& below, const std::string& where) const;
};

}  // namespace fieldgraft
