#include "models/generator/generator.h"

#include <stdexcept>

namespace fieldgraft::generator {
namespace {

Filter filter_of(const std::string& split) {
    if (split == "heldout") return Filter::kHeldOut;
    if (split == "train" || split == "judge_train" || split == "validation") return Filter::kTrain;
    throw std::invalid_argument("Generator: the split is \"" + split + "\", not one of train, judge_train, validation, heldout");
}

}  // namespace

Generator::Generator(uint64_t seed, const std::string& split, int size, const std::string& settings_json)
    : stream_(seed ^ hash_text(split)), filter_(filter_of(split)), size_(size), settings_(settings_from_json(settings_json)) {
    if (size < 16 || size > 512) throw std::invalid_argument("Generator: the size is " + std::to_string(size) + ", not within 16 to 512");
}

PicturePair Generator::make(uint64_t index) const {
    const Rng rng = stream_.fork(index + 1);
    const Pair pair = draw_pair(rng.fork(1), settings_, filter_);
    PicturePair result;
    result.change = pair.change;
    const World worlds[2] = {build_world(pair.scene[0]), build_world(pair.scene[1])};
    // Both are seen by the same camera, which has what the captions speak of in view.
    const View view = make_view(pair.scene[0].view_seed, settings_, minimum(worlds[0].low, worlds[1].low), maximum(worlds[0].high, worlds[1].high));
    for (int k = 0; k < 2; ++k) {
        const SceneSpec& spec = pair.scene[k];
        Picture& picture = result.pictures[k];
        picture.frame = render(worlds[k], view, spec.backdrop, size_);
        picture.caption = caption(spec, pair.plan, settings_);
        picture.spec = to_json(spec);
        picture.said = said_attributes(spec, pair.plan);
        const ObjectSpec& main = spec.objects[0];
        picture.truth = {static_cast<int16_t>(main.shape), static_cast<int16_t>(main.material), static_cast<int16_t>(main.colour)};
        picture.queries = draw_queries(spec, worlds[k], picture.frame, rng.fork(2));
    }
    return result;
}

}  // namespace fieldgraft::generator
