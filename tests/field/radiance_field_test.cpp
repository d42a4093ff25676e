#include "core/field/radiance_field.h"

#include <gtest/gtest.h>

#include <fstream>

#include "core/base/errors.h"
#include "core/base/files.h"
#include "core/base/random.h"
#include "core/field/hash_network.h"
#include "core/kernels/mlp_ref.h"
#include "core/kernels/spherical_harmonics_ref.h"

namespace fieldgraft {
namespace {

namespace fs = std::filesystem;

HashFieldConfig small_config() {
    HashFieldConfig config;
    config.levels = 4;
    config.log2_table_size = 9;
    config.base_resolution = 3;
    config.finest_resolution = 40;
    config.density_hidden = 16;
    config.feature_size = 5;
    config.color_hidden = 12;
    return config;
}

Tensor random_tensor(at::IntArrayRef shape, std::uint64_t seed, float low, float high) {
    Tensor out = at::empty(shape, at::kFloat);
    Random random(seed);
    float* values = out.mutable_data_ptr<float>();
    for (std::int64_t i = 0; i < out.numel(); ++i) values[i] = random.uniform(low, high);
    return out;
}

// A field whose table matters: fresh ones are nearly constant.
RadianceField lively_field(const FieldGeometry& geometry = {}) {
    RadianceField field(small_config(), geometry, 3);
    at::NoGradGuard no_grad;
    Tensor table = field.parameters().at("encoding.table");
    table.copy_(random_tensor(table.sizes(), 4, -1, 1));
    return field;
}

Tensor unit_directions(std::int64_t count, std::uint64_t seed) {
    const Tensor d = random_tensor({count, 3}, seed, -1, 1);
    return d / d.norm(2, 1, true);
}

std::span<const float> span_of(const Tensor& tensor) {
    return {tensor.const_data_ptr<float>(), static_cast<std::size_t>(tensor.numel())};
}

fs::path temporary(const std::string& name) {
    const fs::path folder = fs::path(::testing::TempDir()) / "fieldgraft_field";
    fs::create_directories(folder);
    return folder / name;
}

// The whole network through the reference kernels, one batch at a time.
void reference(const RadianceField& field, const Tensor& positions, const Tensor& directions,
               std::vector<float>& density, std::vector<float>& color) {
    const auto& config = field.config();
    const auto& geometry = field.geometry();
    const HashGrid grid = make_hash_grid(config.levels, config.features_per_level, config.log2_table_size,
                                         config.base_resolution, config.finest_resolution);
    const std::size_t n = positions.size(0);
    double edge = 0;
    for (int c = 0; c < 3; ++c) edge = std::max(edge, geometry.box_max[c] - geometry.box_min[c]);
    std::vector<float> unit(3 * n), encoded(grid.rows() * n);
    for (std::size_t i = 0; i < n; ++i) {
        for (int c = 0; c < 3; ++c) {
            unit[c * n + i] = static_cast<float>((span_of(positions)[3 * i + c] - geometry.box_min[c]) / edge);
        }
    }
    const auto& p = field.parameters();
    hash_grid_forward<float>(grid, span_of(p.at("encoding.table")), unit, encoded);
    std::vector<std::vector<float>> hidden;
    const int rows = static_cast<int>(grid.rows());
    mlp_forward<float>({{rows, config.density_hidden, config.feature_size}},
                       {span_of(p.at("density.0")), span_of(p.at("density.1"))}, encoded, hidden);
    const std::vector<float> features = hidden.back();
    density.resize(n);
    for (std::size_t i = 0; i < n; ++i) density[i] = std::exp(features[i] - 1.0f);
    const int basis = config.sh_degree * config.sh_degree;
    std::vector<float> input((basis + config.feature_size) * n);
    const Tensor d = directions.t().contiguous();
    spherical_harmonics<float>(config.sh_degree, span_of(d), std::span(input).first(basis * n));
    std::copy(features.begin(), features.end(), input.begin() + basis * n);
    mlp_forward<float>({{basis + config.feature_size, config.color_hidden, config.color_hidden, 3}},
                       {span_of(p.at("color.0")), span_of(p.at("color.1")), span_of(p.at("color.2"))}, input, hidden);
    color.resize(3 * n);
    for (std::size_t i = 0; i < n; ++i) {
        for (int c = 0; c < 3; ++c) color[3 * i + c] = 1 / (1 + std::exp(-hidden.back()[c * n + i]));
    }
}

TEST(RadianceField, AgreesWithTheReferenceKernels) {
    FieldGeometry geometry;
    geometry.box_min = {-1, -0.5, -1.5};
    geometry.box_max = {1, 0.75, 1};
    const RadianceField field = lively_field(geometry);
    for (const std::int64_t n : {1, 7, 2048, 2049}) {
        const Tensor positions = random_tensor({n, 3}, n, -0.45f, 0.7f), directions = unit_directions(n, n + 1);
        std::vector<float> density, color;
        reference(field, positions, directions, density, color);
        const auto out = field.density(positions);
        const Tensor shown = field.color(out.features, directions);
        const Tensor expected = at::from_blob(density.data(), {n}, at::kFloat);
        EXPECT_TRUE(at::allclose(out.density, expected, 2e-5, 1e-6)) << (out.density - expected).abs().max();
        EXPECT_TRUE(at::allclose(shown, at::from_blob(color.data(), {n, 3}, at::kFloat), 2e-5, 2e-6));
    }
}

TEST(RadianceField, NothingIsOutsideTheBoxAndNoPointsAreFine) {
    const RadianceField field = lively_field();
    const Tensor positions = torch::tensor({{0.f, 0.f, 0.f}, {1.6f, 0.f, 0.f}, {0.f, -1.51f, 0.f}, {1.5f, 1.5f, 1.5f}});
    const Tensor density = field.density(positions).density;
    EXPECT_GT(density[0].item<float>(), 0);
    EXPECT_EQ(density[1].item<float>(), 0);
    EXPECT_EQ(density[2].item<float>(), 0);
    EXPECT_GT(density[3].item<float>(), 0);
    const auto none = field.density(at::empty({0, 3}));
    EXPECT_EQ(none.density.size(0), 0);
    EXPECT_EQ(field.color(none.features, at::empty({0, 3})).sizes(), (std::vector<std::int64_t>{0, 3}));
    EXPECT_THROW(field.density(at::empty({3})), std::invalid_argument);
    EXPECT_THROW(field.density(at::empty({3, 3}, at::kDouble)), std::invalid_argument);
    EXPECT_THROW(field.color(at::empty({3, 4}), at::empty({3, 3})), std::invalid_argument);
}

// Directional derivative of a loss along a random change of one parameter, by central differences in float.
TEST(RadianceField, GradientsEqualFiniteDifferences) {
    const RadianceField field = lively_field();
    const std::int64_t n = 3000;  // more than one chunk
    const Tensor positions = random_tensor({n, 3}, 1, -1.7f, 1.7f), directions = unit_directions(n, 2);
    const Tensor wd = random_tensor({n}, 3, -1, 1), wc = random_tensor({n, 3}, 4, -1, 1);
    const auto loss = [&] {
        const auto out = field.density(positions);
        return (out.density * wd).to(at::kDouble).sum() +
               (field.color(out.features, directions) * wc).to(at::kDouble).sum();
    };
    loss().backward();
    std::uint64_t seed = 50;
    for (const auto& [name, parameter] : field.parameters()) {
        ASSERT_TRUE(parameter.grad().defined()) << name;
        at::NoGradGuard no_grad;
        // Along the gradient's signs the slope is large against float rounding, and few ReLUs change sides at a small
        // step.
        const Tensor way = parameter.grad().sign() * random_tensor(parameter.sizes(), ++seed, 0.5f, 1.0f);
        const float h = name == "encoding.table" ? 1e-3f : 3e-4f;
        Tensor target = parameter;
        target.add_(way, h);
        const double above = loss().item<double>();
        target.add_(way, -2 * h);
        const double below = loss().item<double>();
        target.add_(way, h);
        const double expected = (above - below) / (2 * h),
                     slope = (parameter.grad() * way).to(at::kDouble).sum().item<double>();
        EXPECT_NEAR(slope / expected, 1.0, 0.01) << name << ": " << slope << " against " << expected;
    }
}

TEST(RadianceField, SameBitsForAnyNumberOfThreadsAndWithoutGradients) {
    const RadianceField field = lively_field();
    const Tensor positions = random_tensor({9000, 3}, 1, -1.5f, 1.5f);
    const int before = at::get_num_threads();
    at::set_num_threads(1);
    const Tensor one = field.density(positions).density.detach();
    at::set_num_threads(2);
    const Tensor two = field.density(positions).density.detach();
    at::set_num_threads(before);
    EXPECT_TRUE(at::equal(one, two));
    at::NoGradGuard no_grad;
    EXPECT_TRUE(at::equal(one, field.density(positions).density));
}

TEST(RadianceField, HugeDensitiesStayFinite) {
    const RadianceField field = lively_field();
    {
        at::NoGradGuard no_grad;
        Tensor weight = field.parameters().at("density.1");
        weight.mul_(1e6f);
    }
    const auto out = field.density(random_tensor({100, 3}, 1, -1.5f, 1.5f));
    EXPECT_TRUE(out.density.isfinite().all().item<bool>());
    EXPECT_GT(out.density.max().item<float>(), 1e6f);
    out.density.sum().backward();
    EXPECT_TRUE(field.parameters().at("density.1").grad().isfinite().all().item<bool>());
}

TEST(RadianceField, SameSeedSameFieldOtherSeedOther) {
    const RadianceField a(small_config(), {}, 1), b(small_config(), {}, 1), c(small_config(), {}, 2);
    EXPECT_EQ(a.hash(), b.hash());
    EXPECT_NE(a.hash(), c.hash());
}

TEST(RadianceField, SavedAndLoadedItIsTheSame) {
    FieldGeometry geometry;
    geometry.frame = {0.5, 0, 0, 1, 0, 0.5, 0, 2, 0, 0, 0.5, 3};
    geometry.white_background = false;
    RadianceField field = lively_field(geometry);
    Tensor occupancy = at::zeros({6, 6, 6}, at::kByte);
    occupancy[1][2][3] = 1;
    field.set_occupancy(occupancy);
    const fs::path path = temporary("field.safetensors");
    field.save(path, {{"note", "äöü"}});
    const auto loaded = RadianceField::load(path);
    EXPECT_EQ(loaded->hash(), field.hash());
    EXPECT_EQ(loaded->config().to_json(), field.config().to_json());
    EXPECT_EQ(loaded->geometry().to_json(), geometry.to_json());
    EXPECT_TRUE(at::equal(loaded->occupancy(), occupancy));
    EXPECT_FALSE(loaded->parameters().at("encoding.table").requires_grad());
    const Tensor x = random_tensor({50, 3}, 8, -1.5f, 1.5f);
    EXPECT_TRUE(at::equal(loaded->density(x).density, field.density(x).density.detach()));
    const std::string before = field.hash();
    field.save(path, {{"note", "another"}});
    EXPECT_EQ(RadianceField::load(path)->hash(), before);  // metadata does not enter
    occupancy[0][0][0] = 1;
    field.set_occupancy(occupancy);
    EXPECT_NE(field.hash(), before);
}

std::string error_of(const fs::path& path) {
    try {
        RadianceField::load(path);
    } catch (const InputError& error) {
        return error.what();
    }
    return "";
}

TEST(RadianceField, DamagedFilesAreNamedInOneLine) {
    const fs::path path = temporary("damaged.safetensors");
    lively_field().save(path);
    const std::string good = read_file(path);
    for (const std::size_t length : {std::size_t{0}, std::size_t{7}, std::size_t{100}, good.size() - 1}) {
        write_file(path, good.substr(0, length));
        const std::string message = error_of(path);
        EXPECT_NE(message.find("damaged.safetensors"), std::string::npos) << length << ": " << message;
        EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    }
    // The same length with another meaning: every change must end in a clear error.
    for (const auto& [from, to] :
         std::vector<std::pair<std::string, std::string>>{{"fieldgraft.field", "fieldgraft.edits"},
                                                          {"density.0", "density.7"},
                                                          {"\\\"hash\\\"", "\\\"mesh\\\""},
                                                          {"\\\"levels\\\":4", "\\\"levels\\\":5"},
                                                          {"\\\"box_min\\\"", "\\\"box_mim\\\""}}) {
        std::string text = good;
        const std::size_t place = text.find(from);
        ASSERT_NE(place, std::string::npos) << from;
        text.replace(place, from.size(), to);
        write_file(path, text);
        const std::string message = error_of(path);
        EXPECT_NE(message.find("damaged.safetensors"), std::string::npos) << from << ": " << message;
    }
    EXPECT_FALSE(error_of(temporary("absent.safetensors")).empty());
}

TEST(RadianceField, RefusesAnOccupancyThatIsNoCubeOfBytes) {
    RadianceField field = lively_field();
    EXPECT_THROW(field.set_occupancy(at::zeros({2, 2, 3}, at::kByte)), std::invalid_argument);
    EXPECT_THROW(field.set_occupancy(at::zeros({2, 2, 2}, at::kFloat)), std::invalid_argument);
}

TEST(FieldGeometry, JsonRoundTripAndErrors) {
    FieldGeometry geometry;
    geometry.focal_x = 1.0 / 3;
    EXPECT_EQ(FieldGeometry::from_json(geometry.to_json()).to_json(), geometry.to_json());
    const Json good = geometry.to_json();
    for (auto item = good.begin(); item != good.end(); ++item) {
        Json json = good;
        json.erase(item.key());
        EXPECT_THROW(FieldGeometry::from_json(json), InputError) << item.key();
    }
    Json json = good;
    json["box_max"] = {1.5, -2.0, 1.5};
    EXPECT_THROW(FieldGeometry::from_json(json), InputError);
}

}  // namespace
}  // namespace fieldgraft
