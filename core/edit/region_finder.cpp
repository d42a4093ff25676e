#include "core/edit/region_finder.h"

#include <spdlog/fmt/ranges.h>

#include "core/base/errors.h"
#include "core/edit/mask_ops.h"
#include "core/edit/ray_sums.h"
#include "core/edit/segmentation.h"
#include "core/edit/volume_cells.h"
#include "core/edit/vote_grid.h"
#include "core/field/cells.h"
#include "core/render/hull.h"

namespace fieldgraft {

namespace {

constexpr int grid_resolution = 96, volume_resolution = 64, survey_size = 128;
constexpr int ball_resolution = 128;  // the field's own: coarser cells show in the outline of what is added
constexpr double user_vote = 5;       // a user's mask against one view of the segmenter
constexpr double hull_share = 0.7;    // of the views that see a cell
constexpr double like_colour = 0.1;   // how far apart two cells' colours may be that are likely of one thing
constexpr int agreement_rounds = 24;
constexpr double colour_step = 0.15;    // between neighbouring cells of one thing, light and shade included
constexpr double doubtful_share = 0.5;  // of the border's votes, for cells that touch the region in its own colour
constexpr int inner_layers = 4;         // how far scores reach into what no view sees
constexpr double core_share = 0.7;      // of the core's score: where the region ends
constexpr double speck_share = 0.02;    // of the largest piece's cells: smaller pieces are one view's noise
constexpr double hanging_share = 0.05;  // of what stays: smaller pieces that lose their hold go with the region
constexpr float seen_weight = 0.05f;

// One view's part in the vote: its camera, its samples and its mask.
struct SurveyView {
    Camera camera;
    BaseSamples base;
    Tensor weight;   // N
    Tensor opacity;  // H·W
    Tensor mask;     // H×W bool
};

class Survey {
  public:
    Survey(const BaseMedium& base, const EditSpec& spec)
        : base_(base), spec_(spec), votes_(base.geometry(), grid_resolution) {}

    SurveyView look(const Camera& camera) const {
        const Rays rays = rays_of_view(camera);
        BaseQuery query;
        query.march.step = box_diagonal() / 512;
        SurveyView view{camera, base_.sample({rays.origins, rays.directions}, query), {}, {}, {}};
        const Samples& samples = view.base.samples;
        view.weight = sample_weights(samples.start, samples.ray, samples.delta, view.base.density);
        view.opacity = sum_over_rays(view.weight, samples.ray, rays.size()).clamp(0, 1);
        return view;
    }
    Tensor picture(const SurveyView& view) const {
        const Tensor color =
            sum_over_rays(view.weight.unsqueeze(1) * view.base.color, view.base.samples.ray, view.opacity.size(0));
        return (color + (1 - view.opacity).unsqueeze(1)).reshape({view.camera.height, view.camera.width, 3});
    }
    // `value`: H×W, how much each pixel says it is the region.
    void vote(SurveyView view, const Tensor& value, double strength) {
        const Tensor flat = value.reshape(-1).to(at::kFloat);
        votes_.add(view.base.samples.positions, flat.index_select(0, view.base.samples.ray), view.weight * strength,
                   view.base.color);
        const Tensor object = view.opacity > 0.5;
        object_pixels_ += object.sum().item<double>();
        region_pixels_ += (flat > 0.5).logical_and(object).sum().item<double>();
        const Tensor mass = view.weight.sum(at::kDouble),
                     moment = (view.weight.unsqueeze(1) * view.base.samples.positions).sum(0);
        mass_ += mass.item<double>();
        for (int a = 0; a < 3; ++a) moment_[a] += moment[a].item<double>();
        const int radius = dilation_radius(spec_.dilations(), view.camera.width);
        views_.push_back({view.camera, dilate(value > 0.5, radius), {}});
    }

    void agree_by_colour() { votes_.agree_by_colour(like_colour, agreement_rounds); }
    const VoteGrid& votes() const { return votes_; }
    double share() const { return object_pixels_ > 0 ? region_pixels_ / object_pixels_ : 0; }
    double region_pixels() const { return region_pixels_; }
    Vec3 centre() const { return mass_ > 0 ? (1 / mass_) * moment_ : base_.geometry().centre; }
    Tensor hull() const {
        const int agreeing = std::min<int>(2, static_cast<int>(views_.size()));
        return visual_hull(base_.geometry(), views_, {volume_resolution, hull_share, agreeing, 0, 0});
    }

  private:
    double box_diagonal() const {
        const FieldGeometry& g = base_.geometry();
        return length(Vec3{g.box_max[0] - g.box_min[0], g.box_max[1] - g.box_min[1], g.box_max[2] - g.box_min[2]});
    }

    const BaseMedium& base_;
    const EditSpec& spec_;
    VoteGrid votes_;
    std::vector<MaskView> views_;
    double object_pixels_ = 0, region_pixels_ = 0, mass_ = 0;
    Vec3 moment_{0, 0, 0};
};

void ask_segmenter(Survey& survey, Guidance& guide, const EditSpec& spec, const EditCameras& cameras,
                   const Reporter& reporter) {
    const std::vector<Camera> views = cameras.survey(spec.region_views, survey_size);
    for (std::size_t i = 0; i < views.size(); ++i) {
        if (reporter.stop_requested()) throw Cancelled();
        SurveyView view = survey.look(views[i]);
        Tensor logits = segment_difference(guide, survey.picture(view), spec.segmented_text());
        if (logits.size(0) != survey_size)
            logits = at::upsample_bilinear2d(logits.reshape({1, 1, logits.size(0), logits.size(1)}),
                                             {survey_size, survey_size}, false)
                         .reshape({survey_size, survey_size});
        survey.vote(std::move(view), at::sigmoid(logits), 1);
        reporter.event({{"event", "progress"}, {"stage", "region"}, {"iteration", i + 1}, {"total", views.size()}});
    }
    if (survey.region_pixels() < 1)
        input_error(
            "--source: the segmenter finds no \"{}\" in any of {} views; use other words, or draw it with --mask "
            "VIEW:FILE",
            spec.segmented_text(), views.size());
}

void ask_masks(Survey& survey, const EditSpec& spec, const Scene* scene) {
    if (scene == nullptr) input_error("--mask: masks are drawn in views of the scene; give it as --scene");
    for (const UserMask& user : spec.masks) {
        const Camera& full = scene->view(user.view).camera;
        const Tensor drawn = read_mask(user.file);
        if (drawn.size(0) * full.width != drawn.size(1) * full.height)
            input_error("--mask {}: {}x{} pixels, but the view {} is {}x{}; draw it over that view", user.file,
                        drawn.size(1), drawn.size(0), user.view, full.width, full.height);
        const Camera camera = scaled(full, std::min(1.0, 200.0 / std::max(full.width, full.height)));
        const Tensor mask = resize_nearest(drawn, camera.height, camera.width);
        if (!mask.any().item<bool>()) input_error("--mask {}: the mask is empty; paint the region white", user.file);
        survey.vote(survey.look(camera), mask, user_vote);
    }
}

// The dilations, seen from the middle of the cameras' range, in cells; at least 1.
int reach_in_cells(const EditSpec& spec, const FieldGeometry& geometry, int resolution) {
    const double radius = (geometry.radius_range[0] + geometry.radius_range[1]) / 2;
    const double pixels = dilation_radius(spec.dilations(), 352) * geometry.image_width / 352.0;
    const double cell = (geometry.box_max[0] - geometry.box_min[0]) / resolution;
    return std::max(1, static_cast<int>(pixels * radius / geometry.focal_x / cell + 0.5));
}

// Where the views' dilated regions agree, near the region: where few cameras look, they agree on too much.
Tensor cells_around(const Tensor& hull, const Tensor& score, int reach) {
    const Tensor region = resampled_cells((score > 0.5).to(at::kByte), volume_resolution);
    return region.any().item<bool>() ? hull.logical_and(dilated(region, reach)).to(at::kByte) : hull;
}

// What removing the region would leave in the air, cell by cell. A film one cell thick beside the region holds nothing.
Tensor hanging_cells(const Tensor& seen, const Tensor& region) {
    const Tensor pieces = cut_off_pieces(seen, dilated(region.to(at::kByte), 1), hanging_share);
    return dilated(pieces, 1).logical_and(seen);
}

// Where density may be added, and what counts as the region in a view then.
void place_volume(EditRegion& region, const Survey& survey, const EditSpec& spec, const EditPlan& plan,
                  const FieldGeometry& geometry) {
    const bool above = spec.resolved_placement() == Placement::above && spec.region_source == RegionSource::segmenter;
    region.volume =
        above ? cells_above(geometry, resampled_cells((region.score > 0.5).to(at::kByte), ball_resolution), 0.45)
              : cells_around(survey.hull(), region.score, reach_in_cells(spec, geometry, volume_resolution));
    region.on_surface = plan.operations.change || plan.operations.remove || !above;
    if (!region.volume.any().item<bool>())
        input_error(
            "--source: the views do not agree on where \"{}\" is; raise --dilate, or draw it with --mask VIEW:FILE",
            spec.segmented_text());
}

Tensor confining_cells(const EditRegion& region, const EditSpec& spec, const FieldGeometry& geometry) {
    const Tensor volume = region.volume.defined() ? resampled_cells(region.volume, grid_resolution) : Tensor();
    if (!region.on_surface) return volume;
    const int reach = reach_in_cells(spec, geometry, grid_resolution);
    const Tensor grown = dilated((region.score > 0.5).to(at::kByte), reach);
    return volume.defined() ? grown.logical_or(volume).to(at::kByte) : grown;
}

}  // namespace

EditRegion find_region(const BaseMedium& base, Guidance& guide, const EditSpec& spec, const EditPlan& plan,
                       const EditCameras& cameras, const Scene* scene, const Reporter& reporter) {
    at::NoGradGuard no_gradients;
    EditRegion region;
    region.centre = base.geometry().centre;
    if (!plan.region_grid) return region;
    Survey survey(base, spec);
    if (spec.region_source != RegionSource::masks) {
        ask_segmenter(survey, guide, spec, cameras, reporter);
        // What goes has to end where the thing ends; paint may be asked for too widely, the text still decides where.
        if (plan.operations.remove) survey.agree_by_colour();
    }
    if (!spec.masks.empty()) ask_masks(survey, spec, scene);
    region.score = survey.votes().score(inner_layers);
    if (spec.region_source != RegionSource::masks) {
        const double surest = region.score.max().item<double>();
        region.score = scaled_to_border(region.score, core_share);
        if (surest > least_vote && surest <= 0.5)
            reporter.warning(fmt::format(
                "the segmenter is not sure where \"{}\" is ({:.0f} % of the votes at most): other words may "
                "say it better, or draw it with --mask VIEW:FILE",
                spec.segmented_text(), 100 * surest));
        Tensor cells = region.score > 0.5;
        // Paint spreads to what half the votes would have sufficed for, where it touches the region in its own colour:
        // a muzzle that some views do not take for the monkey's.
        if (plan.operations.change && !plan.operations.remove) {
            cells = survey.votes().grown_by_colour(cells, region.score > doubtful_share * 0.5, colour_step);
            region.score.masked_fill_(cells.logical_and(region.score <= 0.5), 1);
        }
        if (plan.operations.remove && !plan.operations.change) {
            const Tensor seen = survey.votes().weight() > seen_weight;
            const Tensor hanging = hanging_cells(seen, cells).logical_and(cells.logical_not());
            region.score.masked_fill_(hanging, 1);
            cells = cells.logical_or(hanging);
        }
        region.score.masked_fill_(cells.logical_and(without_specks(cells, speck_share) == 0), 0);
    }
    region.share = survey.share();
    region.centre = survey.centre();
    if (!(region.score > 0.5).any().item<bool>() && !plan.operations.add)
        input_error(
            "--source: no two views agree on where \"{}\" is; use other words, or draw it with --mask VIEW:FILE",
            spec.segmented_text());
    if (plan.march_region) place_volume(region, survey, spec, plan, base.geometry());
    if (spec.confine) region.confine = confining_cells(region, spec, base.geometry());
    return region;
}

Tensor support_candidates(const Operations& operations, const BaseMedium& base, const EditRegion& region) {
    const int resolution = static_cast<int>(base.occupancy().size(0));
    Tensor cells = base.occupancy().to(at::kBool);
    if (operations.add)
        cells = region.volume.defined() ? cells.logical_or(resampled_cells(region.volume, resolution))
                                        : at::ones_like(cells);
    if (region.confine.defined()) cells = cells.logical_and(resampled_cells(region.confine, resolution));
    return cells.to(at::kByte);
}

std::map<std::string, Tensor> EditRegion::tensors() const {
    std::map<std::string, Tensor> tensors;
    if (score.defined()) tensors["region.score"] = score;
    if (volume.defined()) tensors["region.volume"] = volume;
    if (confine.defined()) tensors["region.confine"] = confine;
    return tensors;
}

Json EditRegion::to_json() const {
    return {{"share", share}, {"centre", centre}, {"on_surface", on_surface}};
}

EditRegion EditRegion::restore(const std::map<std::string, Tensor>& tensors, const Json& json) {
    const auto take = [&](const char* name) { return tensors.contains(name) ? tensors.at(name) : Tensor(); };
    EditRegion region{take("region.score"), take("region.volume"), take("region.confine"), true, 0, {}};
    region.share = json.at("share").get<double>();
    region.centre = json.at("centre").get<Vec3>();
    region.on_surface = json.at("on_surface").get<bool>();
    return region;
}

}  // namespace fieldgraft
