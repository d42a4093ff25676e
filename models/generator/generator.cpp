#include "models/generator/generator.h"

#include <algorithm>
#include <stdexcept>

namespace fieldgraft::generator {
namespace {

Filter filter_of(const std::string& split) {
    if (split == "heldout") return Filter::kHeldOut;
    if (split == "train" || split == "judge_train" || split == "validation") return Filter::kTrain;
    throw std::invalid_argument("Generator: the split is \"" + split +
                                "\", not one of train, judge_train, validation, heldout");
}

// At least one pixel in 45 shows the main object.
bool main_is_visible(const World& world, const Frame& frame) {
    size_t count = 0;
    for (const int16_t id : frame.visible) count += id >= 0 && world.primitives[static_cast<size_t>(id)].object == 0;
    return count * 45 >= frame.visible.size();
}

// At least one pixel in 400 differs clearly.
bool change_is_visible(const Frame& a, const Frame& b) {
    const size_t pixels = a.pixels.size() / 3;
    size_t count = 0;
    for (size_t i = 0; i < pixels; ++i) {
        int difference = 0;
        for (size_t k = 0; k < 3; ++k) difference += std::abs(a.pixels[3 * i + k] - b.pixels[3 * i + k]);
        count += difference > 60;
    }
    return count * 400 >= pixels;
}

}  // namespace

Generator::Generator(uint64_t seed, const std::string& split, int size, const std::string& settings_json)
    : stream_(seed ^ hash_text(split)),
      filter_(filter_of(split)),
      size_(size),
      settings_(settings_from_json(settings_json)) {
    if (size < 16 || size > 512)
        throw std::invalid_argument("Generator: the size is " + std::to_string(size) + ", not within 16 to 512");
}

PicturePair Generator::make(uint64_t index) const {
    const Rng rng = stream_.fork(index + 1);
    PicturePair result;
    // Nearly all candidates pass; the last one is taken as it is.
    for (uint64_t attempt = 0; attempt < 12; ++attempt) {
        if (try_make(rng.fork(attempt + 1), attempt == 11, result)) break;
    }
    return result;
}

bool Generator::try_make(Rng rng, bool last, PicturePair& result) const {
    Pair pair = draw_pair(rng.fork(1), settings_, filter_);
    result.change = pair.change;
    const World worlds[2] = {build_world(pair.scene[0]), build_world(pair.scene[1])};
    // Both are seen by the same camera, which has what the captions speak of in view.
    const View view = make_view(pair.scene[0].view_seed, settings_, minimum(worlds[0].low, worlds[1].low),
                                maximum(worlds[0].high, worlds[1].high));
    bool visible = true;
    for (int k = 0; k < 2; ++k) {
        result.pictures[k].frame = render(worlds[k], view, pair.scene[k].backdrop, size_);
        visible = visible && main_is_visible(worlds[k], result.pictures[k].frame);
        if (!visible && !last) return false;
    }
    visible = visible && change_is_visible(result.pictures[0].frame, result.pictures[1].frame);
    const Sight sights[2] = {{pair.scene[0], worlds[0], result.pictures[0].frame},
                             {pair.scene[1], worlds[1], result.pictures[1].frame}};
    for (int k = 0; k < 2; ++k) result.pictures[k].shares = sights[k].main_shares();
    visible = only_what_shows(pair, result) && visible;
    if (!visible && !last) return false;
    for (int k = 0; k < 2; ++k) describe(pair, k, sights[k], rng.fork(2), result.pictures[k]);
    return visible;
}

bool Generator::only_what_shows(Pair& pair, const PicturePair& pictures) const {
    if (settings_.stated_share <= 0) return true;
    bool colour = true, material = true;
    for (int k = 0; k < 2; ++k) {
        const Shares& shares = pictures.pictures[k].shares;
        colour = colour && (pair.scene[k].objects[0].colour < 0 || shares.colour >= settings_.stated_share);
        material = material && shares.material >= settings_.stated_share;
    }
    const bool about_material = pair.change == Change::kMaterial || pair.change == Change::kAddition;
    if (!colour && pair.plan.colour && (pair.change == Change::kColour || about_material)) return false;
    if (!material && pair.plan.material && about_material) return false;
    pair.plan.colour = pair.plan.colour && colour;
    pair.plan.material = pair.plan.material && material;
    return caption(pair.scene[0], pair.plan, settings_) != caption(pair.scene[1], pair.plan, settings_);
}

void Generator::describe(const Pair& pair, int k, const Sight& sight, Rng rng, Picture& picture) const {
    const SceneSpec& spec = pair.scene[k];
    const ObjectSpec& main = spec.objects[0];
    picture.caption = caption(spec, pair.plan, settings_);
    picture.spec = to_json(spec);
    picture.said = said_attributes(spec, pair.plan);
    picture.truth = {static_cast<int16_t>(main.shape), static_cast<int16_t>(main.material),
                     static_cast<int16_t>(main.colour)};
    picture.beside = sight.beside();
    picture.queries = draw_queries(spec, sight, settings_, filter_, rng);
}

}  // namespace fieldgraft::generator
