// The text-driven objective: what the guide thinks of the rendered pictures (Blending-NeRF, sec. 4.2).
//
//   L_clip = w_dir · L_dir(Iᵝ, T_target, Iᵒ, T_source) + w_global · L_global(Iᵝ, T_target) + w_global_edit ·
//   L_global(Iᵉ, T_edit)                                               T_edit: EditSpec::edit_text, T_target in the
//   paper
//
// Pictures are S×S×3 float32 over one background; each goes through the same augmentations (DiffAugment, perspective)
// before it is resized and embedded. Both prompts go through the same random choice of templates. Gradients flow into
// `blended` and `edit`; not into `original`, the texts or the guide.
#pragma once

#include <memory>

#include "core/base/random.h"
#include "core/edit/edit_plan.h"
#include "core/guidance/guidance.h"

namespace fieldgraft {

struct EditImages {
    Tensor original, blended;  // S×S×3
    Tensor edit;               // undefined when the plan has no Iᵉ
};

struct TextTerms {
    Tensor dir, global, global_edit;  // scalars; undefined when the term is off
};

class TextObjective {
  public:
    // Throws InputError for prompts that the guide cannot tell apart.
    TextObjective(std::shared_ptr<Guidance> guide, const EditSpec& spec, const EditPlan& plan);

    // background: 3 colours, what augmentations fill with. Draws from `random`: templates, then augmentations.
    TextTerms evaluate(const EditImages& images, const Tensor& background, Random& random) const;
    // The prompts' mean embeddings over a random choice of templates.
    struct Texts {
        Tensor source, target, edit;
    };
    Texts draw_texts(Random& random) const;

  private:
    std::shared_ptr<Guidance> guide_;
    EditPlan plan_;
    std::string source_, target_, edit_;
    int copies_;
};

}  // namespace fieldgraft
