#include "core/edit/text_objective.h"

#include "core/guidance/augment.h"
#include "core/guidance/clip_losses.h"
#include "core/guidance/templates.h"

namespace fieldgraft {

namespace {

// More sentences say nothing new about a prompt, but each costs a pass through the text tower the first time.
constexpr int most_templates = 8;

Tensor channels_first(const Tensor& image) {
    return image.permute({2, 0, 1}).unsqueeze(0);
}

}  // namespace

TextObjective::TextObjective(std::shared_ptr<Guidance> guide, const EditSpec& spec, const EditPlan& plan)
    : guide_(std::move(guide)),
      plan_(plan),
      source_(spec.source),
      target_(spec.target),
      edit_(spec.edit_text()),
      copies_(spec.augmentations) {
    guide_->check_prompts(source_, target_);
}

TextObjective::Texts TextObjective::draw_texts(Random& random) const {
    const auto& known = guide_->templates();
    const int most = std::min<int>(most_templates, static_cast<int>(known.size()));
    const int count = 1 + static_cast<int>(random.below(static_cast<std::uint32_t>(most)));
    const std::vector<std::string> chosen = choose_templates(known, random, count);
    return {mean_text(guide_->encode_text(expand(source_, chosen))),
            mean_text(guide_->encode_text(expand(target_, chosen))),
            plan_.edit_image ? mean_text(guide_->encode_text(expand(edit_, chosen))) : Tensor()};
}

TextTerms TextObjective::evaluate(const EditImages& images, const Tensor& background, Random& random) const {
    const Texts texts = draw_texts(random);
    AugmentSettings settings;
    settings.copies = copies_;
    settings.colour = guide_->config().augmentation;
    const std::vector<Augmentation> augmentations = draw_augmentations(settings, random);
    const auto views = [&](const Tensor& image) { return augment(channels_first(image), augmentations, background); };

    std::vector<Tensor> live{views(images.blended)};
    if (plan_.edit_image) live.push_back(views(images.edit));
    const Tensor embedded = guide_->encode_image(at::cat(live));
    const Tensor blended = embedded.slice(0, 0, copies_);

    TextTerms terms;
    if (plan_.has("dir")) {
        at::NoGradGuard no_gradients;
        const Tensor original = guide_->encode_image(views(images.original));
        at::AutoGradMode gradients(true);
        terms.dir = directional_loss(original, blended, texts.source, texts.target);
    }
    if (plan_.has("global")) terms.global = global_loss(blended, texts.target);
    if (plan_.edit_image) terms.global_edit = global_loss(embedded.slice(0, copies_), texts.edit);
    return terms;
}

}  // namespace fieldgraft
