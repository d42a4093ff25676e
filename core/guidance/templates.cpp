#include "core/guidance/templates.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>

#include "core/base/errors.h"

namespace fieldgraft {

const std::vector<std::string>& default_templates() {
    static const std::vector<std::string> templates{
        "{}",
        "a photo of {}",
        "a picture of {}",
        "an image of {}",
        "a photograph showing {}",
        "a sharp photo of {}",
        "a detailed photo of {}",
        "a clear picture of {}",
        "a good photo of {}",
        "a bright photo of {}",
        "a high-resolution image of {}",
        "a close-up of {}",
        "a close photo of {}",
        "a studio photo of {}",
        "a product photo of {}",
        "a centred photo of {}",
        "a cropped photo of {}",
        "a photo of the whole {}",
        "a photo of one {}",
        "a photo of {} on a plain background",
        "{} in front of a white background",
        "{} seen from the side",
        "a view of {}",
        "a rendering of {}",
        "a 3D model of {}",
        "a realistic rendering of {}",
        "a scene with {}",
        "there is {} in the picture",
        "this is {}",
        "this picture shows {}",
        "look at {}",
    };
    return templates;
}

void check_template(std::string_view text, const std::string& origin) {
    const std::size_t at = text.find("{}");
    if (at == std::string_view::npos || text.find("{}", at + 2) != std::string_view::npos)
        input_error("{}: the template '{}' must hold {{}} exactly once", origin, text);
}

std::string fill_template(std::string_view text, std::string_view prompt) {
    check_template(text, "template");
    const std::size_t at = text.find("{}");
    return std::string(text.substr(0, at)) + std::string(prompt) + std::string(text.substr(at + 2));
}

std::vector<std::string> choose_templates(std::span<const std::string> templates, Random& random, int count) {
    if (templates.empty()) throw std::invalid_argument("choose_templates: no templates");
    if (count < 1) throw std::invalid_argument(fmt::format("choose_templates: count is {}, must be ≥ 1", count));
    std::vector<std::string> out(templates.begin(), templates.end());
    const std::size_t wanted = std::min(out.size(), static_cast<std::size_t>(count));
    // The head of a Fisher–Yates shuffle.
    for (std::size_t i = 0; i < wanted; ++i)
        std::swap(out[i], out[i + random.below(static_cast<std::uint32_t>(out.size() - i))]);
    out.resize(wanted);
    return out;
}

std::vector<std::string> expand(std::string_view prompt, std::span<const std::string> templates) {
    std::vector<std::string> out;
    for (const std::string& text : templates) out.push_back(fill_template(text, prompt));
    return out;
}

std::vector<std::string> expand(std::string_view prompt, std::span<const std::string> templates, Random& random,
                                int count) {
    return expand(prompt, choose_templates(templates, random, count));
}

}  // namespace fieldgraft
