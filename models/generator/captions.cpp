#include "models/generator/captions.h"

#include "models/generator/shapes.h"

namespace fieldgraft::generator {
namespace {

std::string join(const std::string& a, const std::string& b) {
    return a.empty() ? b : b.empty() ? a : a + " " + b;
}

// Materials that describe the state of a thing come before the colour: "a rusty red truck", but "a red glass bottle".
bool before_colour(int material) {
    return material >= kRusty;
}

std::string colour_phrase(const ObjectSpec& o, bool both) {
    if (o.colour < 0) return "";
    std::string text;
    if (o.lightness != 0) text = o.lightness > 0 ? "light " : "dark ";
    text += colour_name(o.colour);
    if (both && o.colour2 >= 0) text = text + " and " + std::string(colour_name(o.colour2));
    return text;
}

std::string part_list(const ObjectSpec& o, Rng rng) {
    std::string text;
    for (const PartPaint& p : o.paints) {
        if (!p.said) continue;
        std::string phrase = std::string(colour_name(p.colour)) + " " + std::string(part_name(p.part));
        if (!part_is_plural(p.part)) phrase = with_article(phrase);
        text += text.empty() ? "with " : " and ";
        text += phrase;
    }
    for (const int part : o.absent) {
        const bool no = rng.chance(0.25f);
        const std::string name(part_name(part));
        const std::string phrase = part_is_plural(part) || rng.chance(0.4f) ? name : with_article(name);
        text = join(text, (no ? "with no " + name : "without " + phrase));
    }
    return text;
}

// Without article: "rusty red truck with black wheels".
std::string object_phrase(const ObjectSpec& o, const CaptionPlan& plan, bool plural, uint64_t tag) {
    const Rng rng = Rng(plan.seed).fork(tag);
    const bool say_material = plan.material && o.material != kPlain;
    Rng words = rng.fork(static_cast<uint64_t>(o.material) + 10);
    const std::string adjective = say_material && !plan.suffix ? material_adjective(o.material, words) : "";
    const std::string colour = plan.colour ? colour_phrase(o, plan.both_colours) : "";
    std::string text = before_colour(o.material) && !(plan.both_colours && o.colour2 >= 0) ? join(adjective, colour)
                                                                                           : join(colour, adjective);
    text = join(text, noun(o.shape, plural, plan.synonym, rng.fork(2)));
    if (say_material && plan.suffix) text = join(text, material_suffix(o.material, words));
    const std::string parts = part_list(o, rng.fork(3));
    const bool already_with = text.find(" with ") != std::string::npos && parts.starts_with("with ");
    return join(text, already_with ? "and" + parts.substr(4) : parts);
}

std::string addition_phrase(const ObjectSpec& o, const CaptionPlan& plan) {
    CaptionPlan full = plan;
    full.colour = full.material = true;
    full.suffix = full.synonym = false;
    return with_article(object_phrase(o, full, false, 77));
}

std::string main_phrase(const SceneSpec& scene, const CaptionPlan& plan) {
    Rng rng = Rng(plan.seed).fork(5);
    const ObjectSpec& main = scene.objects.at(0);
    int count = 0;
    const ObjectSpec *second = nullptr, *added = nullptr;
    for (const ObjectSpec& o : scene.objects) {
        count += o.role == Role::kMain || o.role == Role::kCopy;
        if (o.role == Role::kSecond) second = &o;
        if (o.role == Role::kAddition) added = &o;
    }
    std::string text = object_phrase(main, plan, count > 1, 1);
    if (plan.with_part >= 0 && main.absent.empty()) {
        const std::string part(part_name(plan.with_part));
        text += (text.find(" with ") != std::string::npos ? " and " : " with ") +
                (part_is_plural(plan.with_part) ? part : with_article(part));
    }
    const float form = rng.uniform();
    if (count > 1) {
        text = (count == 2 ? "two " : "three ") + text;
    } else if (form < 0.7f) {
        text = with_article(text);
    } else if (form > 0.92f) {
        text = "the " + text;
    }
    const bool turned = rng.chance(0.3f);
    if (added) {
        const std::string name(shape_info(added->shape).name);
        const bool worn = name == "hat" || name == "crown";
        const std::string thing = addition_phrase(*added, plan);
        if (turned)
            text = thing + (worn && rng.chance(0.5f) ? " on " : " on top of ") + text;
        else
            text += (worn && rng.chance(0.3f) ? " wearing "
                                              : (text.find(" with ") != std::string::npos ? " and " : " with ")) +
                    thing + (worn ? "" : " on top");
    }
    if (second) {
        const char* const forms[] = {" next to ", " next to ", " beside ", " and "};
        text += forms[rng.below(4)] + with_article(object_phrase(*second, plan, false, 2));
    }
    return text;
}

}  // namespace

std::string with_article(const std::string& phrase) {
    if (phrase.empty()) return phrase;
    const bool vowel = std::string_view("aeiou").find(phrase[0]) != std::string_view::npos;
    return (vowel ? "an " : "a ") + phrase;
}

std::string noun(int shape, bool plural, bool synonym, Rng rng) {
    const ShapeInfo& info = shape_info(shape);
    if (!synonym || info.synonyms.empty()) return std::string(plural ? info.plural : info.name);
    std::string name(info.synonyms[static_cast<size_t>(rng.below(static_cast<int>(info.synonyms.size())))]);
    if (!plural) return name;
    if (name.ends_with('x')) return name + "es";
    if (name.ends_with('y') && name != "monkey") return name.substr(0, name.size() - 1) + "ies";
    return name + "s";
}

std::string ground_phrase(const GroundSpec& ground, Rng rng, bool bare) {
    static const char* const kStuff[kGroundStuffs] = {"",      "wooden", "marble",    "brick",
                                                      "grass", "snow",   "checkered", "beige"};
    const auto stuff = static_cast<size_t>(ground.stuff);
    if (ground.stuff == GroundStuff::kGrass || ground.stuff == GroundStuff::kSnow) {
        return bare ? kStuff[stuff] : std::string(rng.chance(0.3f) ? "on the " : "on ") + kStuff[stuff];
    }
    const char* names[] = {"floor", "ground", "floor"};
    const char* plates[] = {"base plate", "plate", "base"};
    const bool plate = ground.kind == GroundKind::kPlate || ground.kind == GroundKind::kDisc;
    const std::string name = rng.chance(0.6f) && plate ? plates[rng.below(3)] : names[rng.below(3)];
    const std::string phrase =
        join(ground.stuff == GroundStuff::kColour ? std::string(colour_name(ground.colour)) : kStuff[stuff], name);
    return bare ? phrase : "on " + with_article(phrase);
}

CaptionPlan draw_plan(Rng& rng, const Settings& s) {
    CaptionPlan plan;
    const bool bare = rng.chance(s.bare);
    plan.colour = rng.chance(0.85f) && !bare;
    plan.material = rng.chance(0.9f) && !bare;
    plan.ground = rng.chance(s.say_ground);
    plan.backdrop = rng.chance(0.06f);
    plan.synonym = rng.chance(s.synonym);
    plan.suffix = rng.chance(0.4f);
    plan.both_colours = rng.chance(0.35f);
    plan.seed = rng.next();
    return plan;
}

std::string caption(const SceneSpec& scene, const CaptionPlan& plan, const Settings& settings) {
    std::string text = main_phrase(scene, plan);
    Rng rng = Rng(plan.seed).fork(6);
    const Rng words = rng.fork(1);
    const float prefixed = rng.uniform();
    const int prefix = rng.below(8);
    if (plan.ground && scene.ground.kind != GroundKind::kNone) {
        text = join(text, ground_phrase(scene.ground, words, false));
    } else if (plan.backdrop && scene.backdrop.kind == BackdropKind::kColour) {
        text += " on " + with_article(std::string(colour_name(scene.backdrop.colour)) + " background");
    } else if (plan.backdrop && scene.backdrop.kind == BackdropKind::kWhite) {
        text += " on a white background";
    }
    static const char* const kPrefixes[] = {"a photo of ",    "a picture of ", "a render of ",    "an image of ",
                                            "a 3d model of ", "a photo of ",   "a rendering of ", "a close-up of "};
    if (prefixed < settings.prefix) text = kPrefixes[prefix] + text;
    return text;
}

std::array<int16_t, 3> said_attributes(const SceneSpec& scene, const CaptionPlan& plan) {
    const ObjectSpec& main = scene.objects.at(0);
    const bool colour = plan.colour && main.colour >= 0;
    const bool material = main.material == kPlain ? colour : plan.material;
    return {static_cast<int16_t>(main.shape), static_cast<int16_t>(material ? main.material : -1),
            static_cast<int16_t>(colour ? main.colour : -1)};
}

}  // namespace fieldgraft::generator
