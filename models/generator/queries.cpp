#include "models/generator/queries.h"

#include <optional>

#include "models/generator/captions.h"
#include "models/generator/shapes.h"

namespace fieldgraft::generator {
namespace {

constexpr int kFewestSamples = 14;  // of the four a pixel has

// What a query asks of a primitive; −1: anything.
struct Wanted {
    int shape = -1, material = -1, colour = -1, part = -1;
    int piece_colour = -1;  // the colour of the piece itself, not of the object it belongs to
    bool ground = false, addition = false, snow = false, flames = false;
};

class Asker {
  public:
    Asker(const SceneSpec& spec, const World& world, const Frame& frame, Rng rng)
        : spec_(spec), world_(world), frame_(frame), rng_(rng), seen_(world.primitives.size(), 0) {
        for (const int16_t id : frame.visible) {
            if (id >= 0) ++seen_[static_cast<size_t>(id)];
        }
    }

    std::vector<Query> ask() {
        std::vector<Query> list;
        list.push_back(first_of({&Asker::object}));
        list.push_back(first_of({&Asker::part, &Asker::object}));
        list.push_back(rng_.chance(0.75f) ? first_of({&Asker::ground, &Asker::part, &Asker::object})
                                          : first_of({&Asker::object}));
        list.push_back(first_of({&Asker::absent}));
        list.push_back(rng_.chance(0.75f) ? first_of({&Asker::attribute, &Asker::part, &Asker::object})
                                          : first_of({&Asker::absent}));
        const float last = rng_.uniform();
        if (last < 0.3f)
            list.push_back(photo());
        else if (last < 0.65f)
            list.push_back(first_of({&Asker::addition, &Asker::part, &Asker::object}));
        else
            list.push_back(first_of({&Asker::part, &Asker::absent}));
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

    Query photo() const {
        Query q;
        q.text = "photo";
        q.mask.assign(static_cast<size_t>(frame_.size * frame_.size), 0);
        return q;
    }

    const WorldObject& owner(const Primitive& p) const { return world_.objects[static_cast<size_t>(p.object)]; }
    const Paint& paint(const Primitive& p) const { return world_.paints[static_cast<size_t>(p.paint)]; }

    bool matches(const Primitive& p, const Wanted& w) const {
        const WorldObject& o = owner(p);
        if (w.ground) return o.ground;
        if (o.ground) return false;
        if (w.flames) return p.layer == Layer::kFlame;
        if (w.addition && o.role != Role::kAddition) return false;
        if (w.shape >= 0 && o.shape != w.shape) return false;
        if (w.material >= 0 && o.material != w.material) return false;
        if (w.colour >= 0 && o.colour != w.colour) return false;
        if (w.part >= 0 && p.part != w.part) return false;
        if (w.piece_colour >= 0 && (paint(p).colour != w.piece_colour || p.layer == Layer::kFlame)) return false;
        return true;
    }

    bool exists(const Wanted& w) const {
        return std::any_of(world_.primitives.begin(), world_.primitives.end(),
                           [&](const Primitive& p) { return matches(p, w); });
    }

    int samples(const Wanted& w) const {
        int count = 0;
        for (size_t i = 0; i < seen_.size(); ++i) count += matches(world_.primitives[i], w) ? seen_[i] : 0;
        return count;
    }

    Query answer(std::string text, QueryKind kind, const Wanted& w) const {
        Query q;
        q.text = std::move(text);
        q.kind = kind;
        if (w.snow) {
            q.mask = frame_.snow;
            return q;
        }
        std::vector<uint8_t> hit(world_.primitives.size() + 1, 0);
        for (size_t i = 0; i < world_.primitives.size(); ++i) hit[i + 1] = matches(world_.primitives[i], w);
        q.mask.resize(static_cast<size_t>(frame_.size * frame_.size));
        const int n = 2 * frame_.size;
        for (int y = 0; y < frame_.size; ++y) {
            for (int x = 0; x < frame_.size; ++x) {
                int count = 0;
                for (int k = 0; k < 4; ++k)
                    count += hit[static_cast<size_t>(
                        frame_.visible[static_cast<size_t>((2 * y + (k >> 1)) * n + 2 * x + (k & 1))] + 1)];
                q.mask[static_cast<size_t>(y * frame_.size + x)] = count >= 2;
            }
        }
        return q;
    }

    std::string dressed(const std::string& phrase) {
        const float form = rng_.uniform();
        return form < 0.45f ? phrase : form < 0.8f ? with_article(phrase) : "the " + phrase;
    }

    // Index of a primitive that is seen, drawn evenly over objects and parts.
    const Primitive* seen_primitive(bool by_part) {
        std::vector<const Primitive*> list;
        for (size_t i = 0; i < seen_.size(); ++i) {
            const Primitive& p = world_.primitives[i];
            if (seen_[i] == 0 || owner(p).ground || p.layer == Layer::kFlame) continue;
            const bool known = std::any_of(list.begin(), list.end(), [&](const Primitive* q) {
                return q->object == p.object && (!by_part || q->part == p.part);
            });
            if (!known) list.push_back(&p);
        }
        if (list.empty()) return nullptr;
        // The main object's more often than the clutter's.
        if (rng_.chance(0.5f)) {
            std::vector<const Primitive*> main;
            for (const Primitive* p : list) {
                if (p->object == 0) main.push_back(p);
            }
            if (!main.empty()) return main[static_cast<size_t>(rng_.below(static_cast<int>(main.size())))];
        }
        return list[static_cast<size_t>(rng_.below(static_cast<int>(list.size())))];
    }

    std::optional<Query> object() {
        const Primitive* p = seen_primitive(false);
        if (!p) return std::nullopt;
        const WorldObject& o = owner(*p);
        Wanted w;
        w.shape = o.shape;
        std::string text = noun(o.shape, false, rng_.chance(0.12f), rng_.fork(1));
        const float form = rng_.uniform();
        if (form > 0.45f && o.colour >= 0) {
            w.colour = o.colour;
            text = std::string(colour_name(o.colour)) + " " + text;
        }
        if (o.material != kPlain && (form < 0.3f || form > 0.8f)) {
            w.material = o.material;
            Rng words = rng_.fork(2);
            text = form < 0.15f ? text + " " + material_suffix(o.material, words)
                                : material_adjective(o.material, words) + " " + text;
        }
        if (samples(w) < kFewestSamples) return std::nullopt;
        rng_.next();
        return answer(dressed(text), QueryKind::kObject, w);
    }

    std::optional<Query> part() {
        const Primitive* p = seen_primitive(true);
        if (!p || (p->part == kBody && !rng_.chance(0.25f))) return std::nullopt;
        const WorldObject& o = owner(*p);
        if (o.material == kBurning && paint(*p).colour < 0) return std::nullopt;
        Wanted w;
        w.part = p->part;
        std::string text(part_word(p->part, rng_));
        const std::string shape(shape_info(o.shape).name);
        const bool coloured = paint(*p).colour >= 0 && rng_.chance(0.45f) && !two_coloured(*p);
        if (coloured) {
            w.piece_colour = paint(*p).colour;
            text = std::string(colour_name(w.piece_colour)) + " " + text;
        }
        const float form = rng_.uniform();
        if (p->part == kBody || form < 0.35f) {
            w.shape = o.shape;
            text = text + " of " + (rng_.chance(0.5f) ? "the " : "a ") + shape;
        } else if (form < 0.5f && !coloured) {
            w.shape = o.shape;
            text = shape + " " + text;
        }
        if (samples(w) < 10) return std::nullopt;
        return answer(rng_.chance(0.6f) ? text : "the " + text, QueryKind::kPart, w);
    }

    bool two_coloured(const Primitive& p) const {
        return paint(p).material == kStriped || paint(p).material == kDotted;
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
        if (!exists(w))
            return rng_.chance(0.5f) ? std::optional(answer(ground_words(), QueryKind::kAbsent, w)) : std::nullopt;
        if (samples(w) < kFewestSamples) return std::nullopt;
        const std::string text = rng_.chance(0.65f) ? ground_words() : ground_phrase(spec_.ground, rng_.fork(3), true);
        rng_.next();
        return answer(text, QueryKind::kGround, w);
    }

    // Materials whose look may be called by a colour word.
    static uint32_t looks_like(int material) {
        switch (material) {
            case kGold:
                return bit(kYellow) | bit(kOrange) | bit(kBrown);
            case kSilver:
                return bit(kGrey) | bit(kWhite) | bit(kBlack);
            case kGlass:
                return bit(kWhite) | bit(kGrey) | bit(kBlue) | bit(kGreen);
            case kWood:
                return bit(kBrown) | bit(kOrange) | bit(kYellow);
            case kMarble:
                return bit(kWhite) | bit(kGrey) | bit(kBlack);
            case kBrick:
                return bit(kRed) | bit(kBrown) | bit(kOrange);
            case kRusty:
                return bit(kBrown) | bit(kOrange) | bit(kRed);
            case kMossy:
                return bit(kGreen) | bit(kBrown) | bit(kGrey);
            case kSnow:
                return bit(kWhite);
            case kBurning:
                return bit(kRed) | bit(kOrange) | bit(kYellow) | bit(kBlack) | bit(kBrown);
            default:
                return 0;
        }
    }

    // Every colour word that something in the scene might be given.
    uint32_t colours_about() const {
        uint32_t mask = 0;
        for (const Primitive& p : world_.primitives)
            mask |= (paint(p).colour >= 0 ? bit(paint(p).colour) : 0) |
                    looks_like(owner(p).ground ? kPlain : paint(p).material);
        for (const ObjectSpec& o : spec_.objects) mask |= o.colour2 >= 0 ? bit(o.colour2) : 0;
        if (spec_.ground.stuff != GroundStuff::kColour)
            mask |= bit(kBrown) | bit(kGrey) | bit(kWhite) | bit(kRed) | bit(kGreen) | bit(kBlack);
        return mask;
    }

    std::optional<Query> attribute() {
        const Primitive* p = seen_primitive(false);
        if (!p) return std::nullopt;
        const WorldObject& o = owner(*p);
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
            const int colour = paint(*piece).colour;
            if (colour < 0 || two_coloured(*piece) || clash(colour)) return std::nullopt;
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
        if (samples(w) < kFewestSamples) return std::nullopt;
        return answer(text, QueryKind::kAttribute, w);
    }

    // The colour is also a pattern's second colour or the ground's: the mask would be disputable.
    bool clash(int colour) const {
        for (const ObjectSpec& o : spec_.objects) {
            if (o.colour2 == colour || (looks_like(o.material) & bit(colour))) return true;
        }
        return spec_.ground.kind != GroundKind::kNone && spec_.ground.colour == colour;
    }

    std::optional<Query> addition() {
        Wanted w;
        w.addition = true;
        for (const ObjectSpec& o : spec_.objects) {
            if (o.role == Role::kAddition && samples(w) >= 10) {
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
        int snow = 0;
        for (const uint8_t s : frame_.snow) snow += s;
        const bool snowy_ground = spec_.ground.kind != GroundKind::kNone && spec_.ground.stuff == GroundStuff::kSnow;
        if (snow >= 6 && !snowy_ground) {
            cover.snow = true;
            return answer(rng_.chance(0.6f) ? "snow" : "the snow", QueryKind::kAddition, cover);
        }
        cover.flames = true;
        if (samples(cover) < kFewestSamples) return std::nullopt;
        static const char* const kFire[] = {"fire", "flames", "the fire", "the flames"};
        return answer(kFire[rng_.below(4)], QueryKind::kAddition, cover);
    }

    std::optional<Query> absent() {
        Wanted w;
        std::string text;
        const float form = rng_.uniform();
        const int shape = rng_.below(shape_count());
        if (form < 0.3f) {
            w.shape = shape;
            text = dressed(noun(shape, false, rng_.chance(0.1f), rng_.fork(5)));
        } else if (form < 0.5f) {  // the shape may be there, this colour is not
            const Primitive* p = seen_primitive(false);
            const int colour = rng_.below(kColours);
            if (colours_about() & bit(colour)) return std::nullopt;
            w.shape = p && rng_.chance(0.75f) ? owner(*p).shape : shape;
            w.colour = colour;
            text = dressed(std::string(colour_name(colour)) + " " + std::string(shape_info(w.shape).name));
        } else if (form < 0.72f) {
            w.part = absent_part();
            if (w.part < 0) return std::nullopt;
            text = std::string(part_name(w.part));
            if (rng_.chance(0.4f)) text = "the " + text;
        } else if (form < 0.82f) {
            const int material = rng_.between(1, kMaterials - 1);
            w.material = material;
            Rng words = rng_.fork(6);
            const bool as_thing = rng_.chance(0.3f);
            if (!as_thing) w.shape = shape;
            text = dressed(material_adjective(material, words) + " " +
                           (as_thing ? std::string("thing") : std::string(shape_info(shape).name)));
        } else if (form < 0.92f) {
            const int colour = rng_.below(kColours);
            if ((colours_about() & bit(colour)) || colour == kWhite) return std::nullopt;
            w.piece_colour = colour;
            text = rng_.chance(0.5f) ? dressed(std::string(colour_name(colour)) + " thing")
                                     : "something " + std::string(colour_name(colour));
        } else {
            const bool fire = rng_.chance(0.5f);
            for (const ObjectSpec& o : spec_.objects) {
                if (o.material == (fire ? static_cast<int>(kBurning) : static_cast<int>(kSnow))) return std::nullopt;
            }
            if (!fire && spec_.ground.kind != GroundKind::kNone && spec_.ground.stuff == GroundStuff::kSnow)
                return std::nullopt;
            w.flames = true;  // nothing has flames, or else we had returned; the mask is empty either way
            if (!fire) {
                Query q = photo();
                q.kind = QueryKind::kAbsent;
                q.text = rng_.chance(0.6f) ? "snow" : "the snow";
                return q;
            }
            text = rng_.chance(0.5f) ? "fire" : "flames";
        }
        if (exists(w)) return std::nullopt;
        return answer(text, QueryKind::kAbsent, w);
    }

    // A part of some shape that no object here has; often one that this very object has lost.
    int absent_part() {
        for (const ObjectSpec& o : spec_.objects) {
            if (!o.absent.empty() && rng_.chance(0.8f)) return o.absent[0];
        }
        const ShapeInfo& info = shape_info(rng_.below(shape_count()));
        if (info.parts.empty()) return -1;
        const int part = info.parts[static_cast<size_t>(rng_.below(static_cast<int>(info.parts.size())))].part;
        // Words that could be said of nearly anything, or of the ground.
        return part == kBase || part == kTop || part == kFrame || part == kHead || part == kFace ? -1 : part;
    }

    const SceneSpec& spec_;
    const World& world_;
    const Frame& frame_;
    Rng rng_;
    std::vector<int> seen_;
};

}  // namespace

std::vector<Query> draw_queries(const SceneSpec& spec, const World& world, const Frame& frame, Rng rng) {
    return Asker(spec, world, frame, rng).ask();
}

}  // namespace fieldgraft::generator
