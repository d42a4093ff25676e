#include "core/edit/edit_spec.h"

#include <spdlog/fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>

#include "core/base/errors.h"

namespace fieldgraft {

namespace {

std::string lower(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
    return text;
}

bool blank(const std::string& text) {
    return std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isspace(c); });
}

void check_share(const char* flag, double value, double limit) {
    if (!(value >= 0 && value <= limit))
        input_error("{}: {} is not a share; give a number from 0 to {}", flag, value, limit);
}

void check_at_least(const char* flag, double value, double least) {
    if (!(value >= least) || !std::isfinite(value))
        input_error("{}: {} is too small; at least {} is needed", flag, value, least);
}

}  // namespace

const std::vector<std::string>& EditSpec::known_weights() {
    static const std::vector<std::string> names{"dir",    "global",  "global_edit", "region",
                                                "inside", "opacity", "reg",         "smooth"};
    return names;
}

void EditSpec::set_weight(const std::string& name, double value) {
    const auto& names = known_weights();
    if (std::find(names.begin(), names.end(), name) == names.end())
        input_error("--weight: there is no loss term \"{}\"; the known ones are {}", name, fmt::join(names, ", "));
    if (!(value >= 0) || !std::isfinite(value))
        input_error("--weight {}={}: a weight is a finite number from 0 up", name, value);
    weights[name] = value;
}

std::string EditSpec::edit_text() const {
    if (!addition_alone) return target;
    const std::string wanted = lower(target), thing = lower(source), with = " with ";
    const std::size_t found = wanted.find(thing);
    const std::size_t begin = wanted.find(with, found == std::string::npos ? 0 : found + thing.size());
    if (begin == std::string::npos) return "";
    std::string added = target.substr(begin + with.size());
    for (const std::string place : {"on top", "on top of it", "on it", "above it"}) {
        if (lower(added).ends_with(place)) added.resize(added.size() - place.size());
    }
    while (!added.empty() && std::isspace(static_cast<unsigned char>(added.back()))) added.pop_back();
    return added;
}

Placement EditSpec::resolved_placement() const {
    if (placement != Placement::automatic) return placement;
    // What sits on top of a thing rather than all over it.
    const std::string padded = fmt::format(" {} ", lower(target));
    for (const char* word : {" hat ", " crown ", " helmet ", " on top ", " above ", " over "})
        if (padded.find(word) != std::string::npos) return Placement::above;
    return Placement::around;
}

int EditSpec::planned_iterations() const {
    if (iterations > 0) return iterations;
    if (minutes > 0) return 0;
    const double share = quality == "draft" ? 0.25 : quality == "preview" ? 0.5 : 1.0;
    return std::max(1, static_cast<int>(std::lround(share * nominal_iterations)));
}

void EditSpec::validate(int image_width, int image_height) const {
    if (blank(source)) input_error("--source: the prompt is empty; describe what is there now, e.g. \"bulldozer\"");
    if (blank(target)) input_error("--target: the prompt is empty; describe what is wanted, e.g. \"red bulldozer\"");
    if (lower(source) == lower(target))
        input_error("--target: \"{}\" is the same as --source; the two must differ in what the edit changes", target);
    if (!operations.any()) input_error("--ops: no operation; give one or more of add, remove, change");
    if (patch < 8) input_error("--patch: {} pixels is too small; at least 8 are needed", patch);
    if (patch > image_width || patch > image_height)
        input_error("--patch: {} pixels is more than the {}x{} image has; give at most {}", patch, image_width,
                    image_height, std::min(image_width, image_height));
    if (augmentations < 1 || augmentations > 256)
        input_error("--augmentations: {} is out of range; give 1 to 256 copies", augmentations);
    const double limit = tau.relative_to_region ? 10 : 1;
    check_share("--tau-add", tau.add, limit);
    check_share("--tau-remove", tau.remove, limit);
    check_share("--tau-change", tau.change, limit);
    if (dilation < -1 || dilation > 80) input_error("--dilate: {} is out of range; give 0 to 80 dilations", dilation);
    if (iterations < 0) input_error("--iterations: {} is negative; give 1 or more", iterations);
    if (minutes < 0 || !std::isfinite(minutes))
        input_error("--minutes: {} is not a time; give a number above 0", minutes);
    if (quality != "draft" && quality != "preview" && quality != "final")
        input_error("--quality: \"{}\" is unknown; give draft, preview or final", quality);
    if (!(zoom[0] > 0 && zoom[1] >= zoom[0])) input_error("zoom: {} to {} is no range of factors", zoom[0], zoom[1]);
    if (region_source != RegionSource::segmenter && masks.empty())
        input_error("--mask-only: no mask is given; name one or more as --mask VIEW:FILE");
    check_at_least("region_views", region_views, 1);
    check_at_least("camera_pool", camera_pool, 0);
    check_at_least("learning_rate", learning_rate, 1e-12);
    if (resolutions.empty()) input_error("resolutions: g needs at least one grid");
    if (weight("dir") + weight("global") + weight("global_edit") <= 0)
        input_error(
            "--weight: dir, global and global_edit are all 0, so that nothing follows the text; raise one of them");
}

}  // namespace fieldgraft
