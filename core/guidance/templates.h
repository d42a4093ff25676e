// Sentences around a prompt ("red bulldozer" → "a photo of a red bulldozer"): an edit step encodes both prompts within
// a random choice of the same sentences, so that the direction between them does not hang on one wording
// (Blending-NeRF, sec. 4.2; the idea is Text2LIVE's). A template holds "{}" exactly once. Texts only, nothing to
// differentiate.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/random.h"

namespace fieldgraft {

// The sentences for models that bring none of their own.
const std::vector<std::string>& default_templates();
// Throws InputError (naming `origin`) unless the template holds "{}" exactly once.
void check_template(std::string_view text, const std::string& origin);
std::string fill_template(std::string_view text, std::string_view prompt);

// `count` different templates at random (all of them, shuffled, where count is larger); the same choice serves every
// prompt of a step. count ≥ 1, templates not empty.
std::vector<std::string> choose_templates(std::span<const std::string> templates, Random& random, int count);
// The prompt in each of them.
std::vector<std::string> expand(std::string_view prompt, std::span<const std::string> templates);
// The prompt in `count` random templates.
std::vector<std::string> expand(std::string_view prompt, std::span<const std::string> templates, Random& random,
                                int count);

}  // namespace fieldgraft
