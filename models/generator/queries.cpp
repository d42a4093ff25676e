#include "models/generator/queries.h"

#include <optional>

#include "models/generator/captions.h"
#include "models/generator/shapes.h"

namespace fieldgraft::generator {
namespace {

constexpr int kFewestSamples = 14;  // of the four a pixel has

class Asker {
  public:
    Asker(const SceneSpec& spec, const Sight& sight, const Settings& settings, Filter filter, Rng rng)
        : spec_(spec), settings_(settings), filter_(filter), sight_(sight), rng_(rng) {}

    std::vector<Query> ask() {
        std::vector<Query> list;
        list.push_back(first_of({&Asker::object}));
        list.push_back(first_of({&Asker::part, &Asker::object}));
        list.push_back(rng_.chance(0.9f) ? first_of({&Asker::ground, &Asker::part, &Asker::object})
                                         : first_of({&Asker::object}));
        list.push_back(first_of({&Asker::absent}));
        list.push_back(rng_.chance(0.75f) ? first_of({&Asker::attribute, &Asker::part, &Asker::object})
                                          : first_of({&Asker::absent}));
        const float last = rng_.uniform();
        if (last < 0.25f)
            list.push_back(photo());
        else if (last < 0.8f)
            list.push_back(first_of({&Asker::addition, &Asker::part, &Asker::absent}));
        else
            list.push_back(first_of({&Asker::absent}));
        return list;
    }

  private:
    using Ask = std::optional<Query> (Asker::*)();

    Query first_of(std::initializer_list<Ask> ways) {
        for (const Ask way : ways) {
            for (int attempt = 0; attempt < 4; ++attempt) {
                if (auto query = (this->*way)()) return *query;
            }
        }
        return photo();
    }

    Query photo() const { return {"photo", QueryKind::kPhoto, sight_.nothing()}; }

    Query answer(std::string text, QueryKind kind, const Wanted& w) const {
        return {std::move(text), kind, sight_.mask(w)};
    }

    std::string dressed(const std::string& phrase) {
        const float form = rng_.uniform();
        return form < 0.45f ? phrase : form < 0.8f ? with_article(phrase) : "the " + phrase;
    }

    // A primitive that is seen, drawn evenly over objects (or parts); the main object's more often than the clutter's.
    const Primitive* seen_primitive(bool by_part) {
        std::vector<const Primitive*> list = sight_.seen(by_part);
        if (list.empty()) return nullptr;
        std::vector<const Primitive*> main;
        std::copy_if(list.begin(), list.end(), std::back_inserter(main),
                     [](const Primitive* p) { return p->object == 0; });
        if (!main.empty() && rng_.chance(0.5f)) list = main;
        return list[static_cast<size_t>(rng_.below(static_cast<int>(list.size())))];
    }

    std::optional<Query> object() {
        const Primitive* p = seen_primitive(false);
        if (!p) return std::nullopt;
        const WorldObject& o = sight_.owner(*p);
        Wanted w;
        w.shape = o.shape;
        std::string text = noun(o.shape, false, rng_.chance(0.12f), rng_.fork(1));
        const float form = rng_.uniform();
        if (form > 0.45f && o.colour >= 0 && sight_.colour_share(o) >= settings_.stated_share) {
            w.colour = o.colour;
            text = std::string(colour_name(o.colour)) + " " + text;
        }
        if (o.material != kPlain && (form < 0.3f || form > 0.8f)) {
            w.material = o.material;
            Rng words = rng_.fork(2);
            text = form < 0.15f ? text + " " + material_suffix(o.material, words)
                                : material_adjective(o.material, words) + " " + text;
        }
        if (sight_.samples(w) < kFewestSamples) return std::nullopt;
        rng_.next();
        return answer(dressed(text), QueryKind::kObject, w);
    }

    std::optional<Query> part() {
        const Primitive* p = seen_primitive(true);
        if (!p || (p->part == kBody && !rng_.chance(0.25f))) return std::nullopt;
        const WorldObject& o = sight_.owner(*p);
        if (o.material == kBurning && sight_.paint(*p).colour < 0) return std::nullopt;
        Wanted w;
        w.part = p->part;
        std::string text(part_word(p->part, rng_));
        const std::string shape(shape_info(o.shape).name);
        const bool coloured = sight_.paint(*p).colour >= 0 && rng_.chance(0.45f) && !sight_.two_coloured(*p);
        if (coloured) {
            w.piece_colour = sight_.paint(*p).colour;
            text = std::string(colour_name(w.piece_colour)) + " " + text;
        }
        const float form = rng_.uniform();
        if (p->part == kBody || p->part == kBase || form < 0.35f) {
            w.shape = o.shape;
            text = text + " of " + (rng_.chance(0.5f) ? "the " : "a ") + shape;
        } else if (form < 0.5f && !coloured) {
            w.shape = o.shape;
            text = shape + " " + text;
        }
        if (sight_.samples(w) < 10) return std::nullopt;
        return answer(rng_.chance(0.6f) ? text : "the " + text, QueryKind::kPart, w);
    }

    std::string ground_words() {
        static const char* const kWords[] = {"ground", "floor",      "the ground",  "the floor",
                                             "base",   "base plate", "ground plate"};
        const bool plate = spec_.ground.kind == GroundKind::kPlate || spec_.ground.kind == GroundKind::kDisc;
        return kWords[rng_.below(plate ? 7 : 4)];
    }

    std::optional<Query> ground() {
        Wanted w;
        w.ground = true;
        if (!sight_.exists(w))
            return rng_.chance(0.5f) ? std::optional(answer(ground_words(), QueryKind::kAbsent, w)) : std::nullopt;
        if (sight_.samples(w) < kFewestSamples) return std::nullopt;
        const std::string text = rng_.chance(0.65f) ? ground_words() : ground_phrase(spec_.ground, rng_.fork(3), true);
        rng_.next();
        return answer(text, QueryKind::kGround, w);
    }

    std::optional<Query> attribute() {
        const Primitive* p = seen_primitive(false);
        if (!p) return std::nullopt;
        const WorldObject& o = sight_.owner(*p);
        Wanted w;
        std::string text;
        static const char* const kThings[] = {"thing", "object", "one", "thing"};
        const char* thing = kThings[rng_.below(4)];
        if (o.material != kPlain && rng_.chance(0.6f)) {
            w.material = o.material;
            Rng words = rng_.fork(4);
            rng_.next();
            text = rng_.chance(0.5f) ? "something " + material_suffix(o.material, words)
                                     : dressed(material_adjective(o.material, words) + " " + thing);
        } else {
            const Primitive* piece = rng_.chance(0.5f) ? seen_primitive(true) : p;
            const int colour = sight_.paint(*piece).colour;
            if (colour < 0 || sight_.two_coloured(*piece) || sight_.clash(colour)) return std::nullopt;
            if (piece == p && o.colour == colour) {
                w.colour = colour;
                text = dressed(std::string(colour_name(colour)) + " " + thing);
            } else {
                w.piece_colour = colour;
                static const char* const kForms[] = {"something ", "anything ", "", ""};
                const int form = rng_.below(4);
                text = kForms[form] + std::string(colour_name(colour)) + (form == 3 ? " parts" : "");
            }
        }
        if (sight_.samples(w) < kFewestSamples) return std::nullopt;
        return answer(text, QueryKind::kAttribute, w);
    }

    std::optional<Query> addition() {
        Wanted w;
        w.addition = true;
        for (const ObjectSpec& o : spec_.objects) {
            if (o.role == Role::kAddition && sight_.samples(w) >= 10) {
                Wanted named;
                named.shape = o.shape;
                std::string text(shape_info(o.shape).name);
                if (o.colour >= 0 && rng_.chance(0.5f)) {
                    named.colour = o.colour;
                    text = std::string(colour_name(o.colour)) + " " + text;
                }
                return answer(dressed(text), QueryKind::kAddition, named);
            }
        }
        Wanted cover;
        const bool snowy_ground = spec_.ground.kind != GroundKind::kNone && spec_.ground.stuff == GroundStuff::kSnow;
        if (sight_.snow_pixels() >= 6 && !snowy_ground) {
            cover.snow = true;
            return answer(rng_.chance(0.6f) ? "snow" : "the snow", QueryKind::kAddition, cover);
        }
        cover.flames = true;
        if (sight_.samples(cover) < kFewestSamples) return std::nullopt;
        static const char* const kFire[] = {"fire", "flames", "the fire", "the flames"};
        return answer(kFire[rng_.below(4)], QueryKind::kAddition, cover);
    }

    std::optional<Query> absent() {
        if (settings_.shape_for_shape > 0 && rng_.chance(settings_.shape_for_shape)) return absent_shape_of_colour();
        const float form = rng_.uniform();
        if (form < 0.3f) return absent_shape();
        if (form < 0.5f) return absent_colour_of_shape();
        if (form < 0.72f) return absent_part();
        if (form < 0.82f) return absent_material();
        if (form < 0.92f) return absent_colour();
        return absent_cover();
    }

    std::optional<Query> empty(const std::string& text, const Wanted& w) const {
        if (sight_.exists(w)) return std::nullopt;
        return Query{text, QueryKind::kAbsent, sight_.nothing()};
    }

    std::optional<Query> absent_shape() {
        Wanted w;
        w.shape = rng_.below(shape_count());
        const bool synonym = rng_.chance(0.1f);
        return empty(dressed(noun(w.shape, false, synonym, rng_.fork(5))), w);
    }

    // The colour is there, on another shape.
    std::optional<Query> absent_shape_of_colour() {
        const Primitive* p = seen_primitive(false);
        if (!p || sight_.owner(*p).colour < 0) return std::nullopt;
        Wanted w;
        w.colour = sight_.owner(*p).colour;
        w.shape = rng_.below(shape_count());
        if (kept(w.shape, kPlain, w.colour)) return std::nullopt;
        return empty(dressed(std::string(colour_name(w.colour)) + " " + std::string(shape_info(w.shape).name)), w);
    }

    bool kept(int shape, int material, int colour) const {
        return filter_ == Filter::kTrain && is_held_out(shape, material, colour);
    }

    // The shape is likely to be there, the colour is not.
    std::optional<Query> absent_colour_of_shape() {
        const Primitive* p = seen_primitive(false);
        Wanted w;
        w.colour = rng_.below(kColours);
        if (sight_.colours_about() & bit(w.colour)) return std::nullopt;
        w.shape = p && rng_.chance(0.75f) ? sight_.owner(*p).shape : rng_.below(shape_count());
        if (kept(w.shape, kPlain, w.colour)) return std::nullopt;
        return empty(dressed(std::string(colour_name(w.colour)) + " " + std::string(shape_info(w.shape).name)), w);
    }

    std::optional<Query> absent_material() {
        Wanted w;
        w.material = rng_.between(1, kMaterials - 1);
        Rng words = rng_.fork(6);
        std::string thing = "thing";
        if (rng_.chance(0.7f)) {
            w.shape = rng_.below(shape_count());
            if (kept(w.shape, w.material, -1)) return std::nullopt;
            thing = shape_info(w.shape).name;
        }
        return empty(dressed(material_adjective(w.material, words) + " " + thing), w);
    }

    std::optional<Query> absent_colour() {
        Wanted w;
        w.piece_colour = rng_.below(kColours);
        if ((sight_.colours_about() & bit(w.piece_colour)) || w.piece_colour == kWhite) return std::nullopt;
        const std::string colour(colour_name(w.piece_colour));
        return empty(rng_.chance(0.5f) ? dressed(colour + " thing") : "something " + colour, w);
    }

    std::optional<Query> absent_cover() {
        const bool fire = rng_.chance(0.5f);
        const int material = fire ? kBurning : kSnow;
        const auto covered = [material](const ObjectSpec& o) { return o.material == material; };
        if (std::any_of(spec_.objects.begin(), spec_.objects.end(), covered)) return std::nullopt;
        if (!fire && spec_.ground.kind != GroundKind::kNone && spec_.ground.stuff == GroundStuff::kSnow)
            return std::nullopt;
        static const char* const kWords[] = {"snow", "the snow", "fire", "flames"};
        return Query{kWords[(fire ? 2 : 0) + rng_.below(2)], QueryKind::kAbsent, sight_.nothing()};
    }

    // A part of some shape that no object here has; often one that this very object has lost.
    std::optional<Query> absent_part() {
        Wanted w;
        for (const ObjectSpec& o : spec_.objects) {
            if (!o.absent.empty() && rng_.chance(0.8f)) w.part = o.absent[0];
        }
        if (w.part < 0) {
            const ShapeInfo& info = shape_info(rng_.below(shape_count()));
            if (info.parts.empty()) return std::nullopt;
            w.part = info.parts[static_cast<size_t>(rng_.below(static_cast<int>(info.parts.size())))].part;
        }
        // Words that could be said of nearly anything, or of the ground.
        for (const int vague : {kBase, kTop, kFrame, kHead, kFace, kBody}) {
            if (w.part == vague) return std::nullopt;
        }
        const std::string text(part_word(w.part, rng_));
        return empty(rng_.chance(0.4f) ? "the " + text : text, w);
    }

    const SceneSpec& spec_;
    const Settings& settings_;
    Filter filter_;
    const Sight& sight_;
    Rng rng_;
};

}  // namespace

std::vector<Query> draw_queries(const SceneSpec& spec, const Sight& sight, const Settings& settings, Filter filter,
                                Rng rng) {
    return Asker(spec, sight, settings, filter, rng).ask();
}

}  // namespace fieldgraft::generator
