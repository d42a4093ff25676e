#include "core/edit/metrics.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include "core/base/errors.h"
#include "core/guidance/clip_losses.h"
#include "core/guidance/templates.h"

namespace fieldgraft {

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

void check_view(const EditedView& view) {
    if (view.original.dim() != 3 || view.original.size(2) != 3 || view.original.sizes() != view.edited.sizes())
        throw std::invalid_argument("measure_edit: original and edited must both be H×W×3");
    for (const Tensor* mask : {&view.object, &view.region})
        if (mask->defined() && (mask->scalar_type() != at::kBool || mask->sizes() != view.original.sizes().slice(0, 2)))
            throw std::invalid_argument("measure_edit: object and region must be H×W bool");
}

struct Mean {
    double sum = 0, count = 0;
    void add(const EditedView& view, const Tensor& mask) {
        const Tensor change = (view.edited - view.original).abs().mean(2);
        const Tensor kept = mask.defined() ? change.masked_select(mask) : change;
        sum += kept.sum(at::kDouble).item<double>();
        count += static_cast<double>(kept.numel());
    }
    double value() const { return count > 0 ? sum / count : nan; }
};

// Both similarities by the judge, averaged over the views.
void judge_views(const std::vector<EditedView>& views, Guidance& judge, const std::string& source,
                 const std::string& target, EditMetrics& metrics) {
    at::NoGradGuard no_gradients;
    const auto embed_text = [&](const std::string& prompt) {
        return mean_text(judge.encode_text(expand(prompt, judge.templates())));
    };
    const Tensor from = embed_text(source), to = embed_text(target);
    double similarity = 0, directional = 0;
    for (const EditedView& view : views) {
        const Tensor pair = at::stack({view.original, view.edited}).permute({0, 3, 1, 2});
        const Tensor embedded = to_unit(judge.encode_image(pair));
        similarity += soft_cosine(embedded[1], to, 1e-12).item<double>();
        directional += 1 - directional_loss(embedded.slice(0, 0, 1), embedded.slice(0, 1, 2), from, to).item<double>();
    }
    metrics.similarity = similarity / static_cast<double>(views.size());
    metrics.directional = directional / static_cast<double>(views.size());
    metrics.s_clip = (metrics.similarity + metrics.directional) / 2;
    metrics.mp_clip = (1 - metrics.d_l1) * metrics.s_clip;
}

}  // namespace

double mean_change(const Tensor& original, const Tensor& edited, const Tensor& mask) {
    const EditedView view{original, edited, {}, mask};
    check_view(view);
    Mean mean;
    mean.add(view, mask);
    return mean.value();
}

EditMetrics measure_edit(const std::vector<EditedView>& views, Guidance* judge, const std::string& source,
                         const std::string& target) {
    if (views.empty()) throw std::invalid_argument("measure_edit: no views");
    Mean whole, inside, outside, outside_object;
    for (const EditedView& view : views) {
        check_view(view);
        whole.add(view, Tensor());
        if (!view.region.defined()) continue;
        const Tensor rest = view.region.logical_not();
        inside.add(view, view.region);
        outside.add(view, rest);
        outside_object.add(view, view.object.defined() ? rest.logical_and(view.object) : rest);
    }
    EditMetrics metrics;
    metrics.d_l1 = whole.value();
    metrics.d_l1_inside = inside.value();
    metrics.d_l1_outside = outside.value();
    metrics.d_l1_outside_object = outside_object.value();
    metrics.s_clip = metrics.similarity = metrics.directional = metrics.mp_clip = nan;
    if (judge != nullptr) judge_views(views, *judge, source, target, metrics);
    return metrics;
}

Json EditMetrics::to_json() const {
    Json json = Json::object();
    const auto put = [&](const char* name, double value) {
        if (std::isfinite(value)) json[name] = value;
    };
    put("d_l1", d_l1);
    put("d_l1_inside", d_l1_inside);
    put("d_l1_outside", d_l1_outside);
    put("d_l1_outside_object", d_l1_outside_object);
    put("similarity", similarity);
    put("directional", directional);
    put("s_clip", s_clip);
    put("mp_clip", mp_clip);
    return json;
}

}  // namespace fieldgraft
