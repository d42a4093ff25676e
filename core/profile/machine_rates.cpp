#include "core/profile/machine_rates.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "core/base/errors.h"
#include "core/base/files.h"
#include "core/base/process.h"
#include "core/base/torch.h"
#include "core/field/cells.h"
#include "core/render/render_view.h"
#include "core/scene/ball_views.h"
#include "core/train/field_optimizer.h"
#include "core/train/fit_batch.h"
#include "core/train/occupancy_grid.h"
#include "core/train/trainer.h"
#include "vdb_export/content_edge.h"
#include "vdb_export/vdb_export.h"
#include "vdb_export/volume_source.h"

namespace fieldgraft {
namespace {

// Scenes have more to them than the shell: pictures to draw rays from, cold memory, first looks into all cells. Lego,
// the demo and the house took 1.16 to 1.22 times as long to train and .95 to 1.33 times to draw.
constexpr double scenes_take = 1.17;
constexpr double shell_radius = 0.6, shell_half_width = 0.02;
constexpr int small_table = 16, large_table = 18, narrow = 32, wide = 64;
// Of a short run's field (2^16 entries, 32 wide), on the machine on which TrainOptions' budgets were chosen.
constexpr double reference_fit_ns = 430;

// Of both networks, a sample.
double multiply_adds(const HashFieldConfig& field) {
    const double encoded = field.levels * field.features_per_level, basis = field.sh_degree * field.sh_degree;
    const double d = field.density_hidden, c = field.color_hidden, features = field.feature_size;
    return encoded * d + d * features + (basis + features) * c + c * c + 3 * c;
}

HashFieldConfig measured_field(int log2_table, int width) {
    HashFieldConfig field;
    field.log2_table_size = log2_table;
    field.density_hidden = field.color_hidden = width;
    return field;
}

// Random weights made dense and lively within a shell: something to look at that needs no training, as thin as what
// training leaves of a thing.
std::shared_ptr<RadianceField> shell_of(const HashFieldConfig& config) {
    constexpr int cells = 128;
    auto field = std::make_shared<RadianceField>(config, FieldGeometry{}, 1);
    at::NoGradGuard no_grad;
    field->parameters().at("encoding.table").mul_(1e4);
    field->parameters().at("density.1").mul_(3);
    const Tensor all = at::arange(std::int64_t{1} * cells * cells * cells, at::kLong);
    const Tensor distance = cell_points(field->geometry(), cells, all, {0.5, 0.5, 0.5}).norm(2, 1);
    const Tensor shell = (distance - shell_radius).abs().lt(shell_half_width);
    field->set_occupancy(shell.to(at::kByte).view({cells, cells, cells}));
    return field;
}

// Nanoseconds a visible sample, of whole steps: forward, backward, Adam, a look at some of the occupancy every so
// often.
double fitting_cost(RadianceField& field) {
    constexpr int warm = 4, measured = 60, refresh_interval = 16;
    constexpr std::int64_t rays = 4096;
    Random random(1, 0x6d616368u);
    ImageSet images;
    images.cameras = ball_cameras(8, 200);
    for (const Camera& camera : images.cameras) {
        images.pixels.push_back(ball_pixels(camera));
        images.masks.emplace_back();
    }
    OccupancyGrid occupancy(field.geometry(), static_cast<int>(field.occupancy().size(0)),
                            march_step(field.geometry(), {}));
    FieldOptimizer optimizer(field);
    const MarchGrid cells = march_grid_of(field.geometry(), field.occupancy());
    const BatchOptions how{TrainOptions().network_precision(), march_step(field.geometry(), {}), 0, {}};
    std::vector<double> ns;
    for (int i = 0; i < warm + measured; ++i) {
        const Stopwatch watch;
        const RayBatch batch = draw_rays(images, rays, random);
        std::vector<RangeFit> fits = fit_batch(field, cells, batch, how, random);
        optimizer.step(field, 1e-9, fits);  // what is measured stays what it is
        if (i % refresh_interval == 0) occupancy.refresh_some(field, random);
        std::size_t samples = 0;
        for (const RangeFit& part : fits) samples += part.samples;
        if (i >= warm) ns.push_back(1e9 * watch.seconds() / static_cast<double>(std::max<std::size_t>(samples, 1)));
    }
    std::nth_element(ns.begin(), ns.begin() + measured / 2, ns.end());
    return ns[measured / 2];
}

RayBundle bundle_of(const Camera& camera) {
    const Rays rays = rays_of_view(camera);
    return {rays.origins, rays.directions};
}

// Seconds of a picture, rays made anew, the best of five: what else the machine does only ever adds.
double drawing_seconds(const RadianceField& field, const Camera& camera, const RenderOptions& options) {
    double best = std::numeric_limits<double>::infinity();
    for (int i = 0; i < 5; ++i) {
        const Stopwatch watch;
        render_rays(field, bundle_of(camera), options);
        best = std::min(best, watch.seconds());
    }
    return best;
}

double samples_of(const RadianceField& field, const Camera& camera, const RenderOptions& options) {
    return static_cast<double>(count_samples(field, bundle_of(camera), options).looked_at);
}

struct DrawingCost {
    double ray, sample;  // ns
};

// From pictures with short steps and with long ones: as many rays, and fewer samples.
DrawingCost drawing_cost(const RadianceField& field) {
    const Camera camera = ball_cameras(1, 240).front();
    const double count = static_cast<double>(camera.width) * camera.height;
    RenderOptions fine, coarse;
    coarse.march.step = 4 * march_step(field.geometry(), {});
    const double samples[2] = {samples_of(field, camera, fine), samples_of(field, camera, coarse)};
    const double seconds[2] = {drawing_seconds(field, camera, fine), drawing_seconds(field, camera, coarse)};
    const double sample = std::max(0.0, (seconds[0] - seconds[1]) / std::max(1.0, samples[0] - samples[1]));
    return {1e9 * std::max(0.0, seconds[0] - sample * samples[0]) / count, 1e9 * sample};
}

Content coarse_look(const RadianceField& field) {
    return content_of(field.geometry(), volume_source(field, {}), {});
}

// How many voxels a bake of so many along the thing works on: as much volume as those of the coarse look that it begins
// with, and those.
double worked_on(const FieldGeometry& geometry, const Content& content, int resolution) {
    const double coarse = longest_edge(geometry) / 128;
    return static_cast<double>(content.voxels) * (1 + std::pow(coarse / (content.edge / resolution), 3));
}

struct BakingCost {
    double whole, voxel;  // ns
};

// From bakes of few and of many voxels: what all bakes do, and what each voxel that is held adds.
BakingCost baking_cost(const RadianceField& field) {
    constexpr int resolutions[2] = {64, 144};
    const auto path = std::filesystem::temp_directory_path() / fmt::format("fieldgraft_{}.vdb", process_id());
    BakeOptions options;
    options.threshold = 0;  // all of the shell
    double seconds[2], voxels[2];
    for (int i = 0; i < 2; ++i) {
        options.resolution = resolutions[i];
        const BakeReport report = bake(field, {}, path, options);
        seconds[i] = report.seconds;
        voxels[i] = static_cast<double>(report.voxels);
    }
    std::filesystem::remove(path);
    const double voxel = std::max(0.0, seconds[1] - seconds[0]) / std::max(1.0, voxels[1] - voxels[0]);
    const double coarse = static_cast<double>(coarse_look(field).voxels);
    return {1e9 * std::max(0.0, seconds[0] - voxel * (voxels[0] + coarse)), 1e9 * voxel};
}

Json rate_json(const WorkRate& rate) {
    return {{"base", rate.base}, {"product", rate.product}, {"table", rate.table}};
}

WorkRate rate_of(const Json& json) {
    return {json.at("base").get<double>(), json.at("product").get<double>(), json.at("table").get<double>()};
}

}  // namespace

double WorkRate::of(const HashFieldConfig& field) const {
    const double larger = std::max(0, field.log2_table_size - small_table);
    return base + product * multiply_adds(field) + table * larger;
}

WorkRate rate_through(const std::array<MeasuredRate, 3>& measured) {
    const auto& [small, large, wider] = measured;
    WorkRate rate;
    rate.table = std::max(0.0, large.ns - small.ns) / (large.field.log2_table_size - small.field.log2_table_size);
    const double products = multiply_adds(large.field);
    rate.product = std::max(0.0, wider.ns - large.ns) / (multiply_adds(wider.field) - products);
    rate.base = std::max(0.0, small.ns - rate.product * multiply_adds(small.field));
    return rate;
}

double MachineRates::speed() const {
    return reference_fit_ns / fit.of(measured_field(small_table, narrow));
}

Json MachineRates::to_json() const {
    return {{"machine", machine}, {"threads", threads},        {"fit", rate_json(fit)}, {"draw", rate_json(draw)},
            {"ray", ray},         {"voxel", rate_json(voxel)}, {"bake", bake}};
}

MachineRates MachineRates::from_json(const Json& json) {
    return {json.at("machine").get<std::string>(),
            json.at("threads").get<int>(),
            rate_of(json.at("fit")),
            rate_of(json.at("draw")),
            rate_of(json.at("voxel")),
            json.at("ray").get<double>(),
            json.at("bake").get<double>()};
}

MachineRates measure_machine(const Reporter& reporter) {
    std::array<MeasuredRate, 3> fit, draw, voxel;
    MachineRates rates;
    const std::array<HashFieldConfig, 3> fields{measured_field(small_table, narrow),
                                                measured_field(large_table, narrow), measured_field(large_table, wide)};
    for (std::size_t i = 0; i < fields.size(); ++i) {
        if (reporter.stop_requested()) throw Cancelled();
        const std::shared_ptr<RadianceField> field = shell_of(fields[i]);
        fit[i] = {fields[i], fitting_cost(*field)};
        const DrawingCost drawn = drawing_cost(*field);
        draw[i] = {fields[i], drawn.sample};
        const BakingCost baked = baking_cost(*field);
        voxel[i] = {fields[i], baked.voxel};
        rates.ray += drawn.ray / static_cast<double>(fields.size());
        rates.bake += baked.whole / static_cast<double>(fields.size());
        reporter.event({{"event", "progress"}, {"iteration", i + 1}, {"total", fields.size()}});
    }
    rates.machine = machine_name();
    rates.threads = at::get_num_threads();
    rates.fit = rate_through(fit);
    rates.draw = rate_through(draw);
    rates.voxel = rate_through(voxel);
    return rates;
}

std::filesystem::path machine_file() {
    const char *cache = std::getenv("XDG_CACHE_HOME"), *home = std::getenv("HOME");
    const std::filesystem::path folder = cache != nullptr && *cache != '\0' ? std::filesystem::path(cache)
                                         : home != nullptr && *home != '\0' ? std::filesystem::path(home) / ".cache"
                                                                            : std::filesystem::temp_directory_path();
    return folder / "fieldgraft" / "machine.json";
}

void save_rates(const MachineRates& rates) {
    write_file(machine_file(), rates.to_json().dump(1) + "\n");
}

std::optional<MachineRates> load_rates() {
    try {
        const MachineRates rates = MachineRates::from_json(Json::parse(read_file(machine_file())));
        const bool ours = rates.machine == machine_name() && rates.threads == at::get_num_threads();
        return ours ? std::optional(rates) : std::nullopt;
    } catch (const InputError&) {
        return {};
    } catch (const Json::exception&) {
        return {};  // somebody else's, or an earlier version's: as good as none
    }
}

double training_seconds(const MachineRates& rates, const HashFieldConfig& field, double samples) {
    return 1e-9 * samples * scenes_take * rates.fit.of(field);
}

double view_seconds(const MachineRates& rates, const RadianceField& field, const Camera& camera) {
    const double rays = static_cast<double>(camera.width) * camera.height;
    const Camera small = scaled(camera, 0.125);
    const double samples = samples_of(field, small, {}) / (static_cast<double>(small.width) * small.height);
    return 1e-9 * rays * scenes_take * (rates.ray + samples * rates.draw.of(field.config()));
}

std::vector<double> bake_seconds(const MachineRates& rates, const RadianceField& field,
                                 const std::vector<int>& resolutions) {
    const Content content = coarse_look(field);
    const double voxel = rates.voxel.of(field.config());
    std::vector<double> seconds;
    for (const int resolution : resolutions)
        seconds.push_back(1e-9 * (rates.bake + worked_on(field.geometry(), content, resolution) * voxel));
    return seconds;
}

}  // namespace fieldgraft
