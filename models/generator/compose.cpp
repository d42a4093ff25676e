#include "models/generator/compose.h"

#include <stdexcept>

#include "models/generator/draw.h"
#include "models/generator/shapes.h"
#include "models/generator/world.h"

namespace fieldgraft::generator {

bool allowed(const ObjectSpec& o, Filter filter, bool main) {
    const bool held = is_held_out(o.shape, o.material, o.colour);
    return filter == Filter::kTrain ? !held : (!main || held);
}

int draw_shape(Rng& rng) {
    float total = 0;
    for (int i = 0; i < shape_count(); ++i) total += shape_info(i).weight;
    float at = rng.uniform() * total;
    for (int i = 0; i < shape_count(); ++i) {
        at -= shape_info(i).weight;
        if (at < 0) return i;
    }
    return shape_count() - 1;
}

int colour_out_of(uint32_t mask, Rng& rng) {
    const int start = rng.below(kColours);
    for (int i = 0; i < kColours; ++i) {
        const int c = (start + i * 4) % kColours;  // 4 and 11 share no factor: every colour is tried
        if (mask == 0 || (mask >> c & 1u)) return c;
    }
    return start;
}

namespace {

// Colours of the chosen material; the second one of stripes and dots stands out from the first.
void draw_colours(ObjectSpec& o, Rng rng) {
    o.colour = o.colour2 = -1;
    o.lightness = 0;
    constexpr float kChance[kMaterials] = {1, 0, 0, 0.5f, 0, 0, 0, 0.35f, 0.25f, 0.7f, 0.3f, 1, 1};
    const uint32_t usual = shape_info(o.shape).usual_colours;
    const bool from_usual = rng.chance(0.25f);
    const int colour = colour_out_of(usual && from_usual ? usual : 0, rng);
    if (rng.chance(kChance[o.material])) o.colour = colour;
    const uint32_t contrast = bit(kBlack) | bit(kWhite) | bit(kYellow) | bit(kRed) | bit(kBlue);
    const int second = colour_out_of((rng.chance(0.6f) ? bit(kWhite) : contrast) & ~bit(colour), rng);
    if (o.material == kStriped || o.material == kDotted)
        o.colour2 = second != colour ? second : (colour == kWhite ? kRed : kWhite);
    const bool shaded = rng.chance(0.1f);
    const uint32_t dark = bit(kRed) | bit(kGreen) | bit(kBlue) | bit(kPurple) | bit(kGrey),
                   light = bit(kGreen) | bit(kBlue) | bit(kPurple);
    const bool lighter = rng.chance(0.4f);
    if (shaded && o.material == kPlain && (bit(colour) & (lighter ? light : dark))) o.lightness = lighter ? 1 : -1;
}

}  // namespace

void draw_paints(ObjectSpec& o, const Settings& s, Rng rng) {
    o.paints.clear();
    const bool whole = o.material != kPlain && !(o.material >= kRusty && o.material <= kBurning);
    const float keep = whole && !rng.chance(o.material >= kStriped ? 0.5f : 0.25f) ? 0.0f : s.own_part_colours;
    for (const PartRule& rule : shape_info(o.shape).parts) {
        const bool own = rng.chance(rule.own * keep), natural = rng.chance(0.8f), said = rng.chance(s.say_part * 0.5f);
        const int colour = colour_out_of(natural ? rule.natural : 0, rng);
        if (own) o.paints.push_back({rule.part, colour, said});
    }
}

namespace {

ObjectSpec draw_object(Role role, const Settings& s, Filter filter, Rng rng) {
    ObjectSpec o;
    o.role = role;
    for (int attempt = 0;; ++attempt) {
        o.shape = draw_shape(rng);
        o.material = rng.chance(s.plain) ? static_cast<int>(kPlain) : rng.between(1, kMaterials - 1);
        draw_colours(o, rng.fork(static_cast<uint64_t>(attempt) + 100));
        if (allowed(o, filter, role == Role::kMain)) break;
        if (attempt > 2000) throw std::runtime_error("draw_object: no combination passes the filter after 2000 draws");
    }
    draw_paints(o, s, rng.fork(1));
    o.seed = rng.next();
    o.yaw = rng.uniform(0, 2 * kPi);
    const bool lies = shape_info(o.shape).tumbles && rng.chance(s.primitive_tumbles);
    const float tilt = rng.uniform(-kPi, kPi);
    if (lies) o.tilt = tilt;
    return o;
}

float flat_radius(const Footprint& f) {
    return std::max(f.half.x, f.half.y);
}

// Beside the main object, near enough to be seen with it.
void place_beside(ObjectSpec& o, float main_radius, float angle, float gap) {
    const float r = main_radius + flat_radius(footprint(o)) * o.size + gap;
    o.position = {r * cosine(angle), r * sine(angle), 0};
}

}  // namespace

ObjectSpec draw_addition(const ObjectSpec& host, const Settings& s, Filter filter, Rng rng) {
    static const int kinds[] = {shape_named("hat"),  shape_named("hat"),  shape_named("hat"),  shape_named("crown"),
                                shape_named("ball"), shape_named("cube"), shape_named("cone"), shape_named("flower")};
    ObjectSpec o = draw_object(Role::kAddition, s, Filter::kTrain, rng.fork(1));
    const int shape = kinds[rng.below(8)];
    for (int attempt = 0; attempt < 200; ++attempt) {
        o.shape = shape;
        o.material = rng.chance(0.75f) ? static_cast<int>(kPlain)
                                       : (rng.chance(0.5f) ? static_cast<int>(kGold) : static_cast<int>(kSilver));
        draw_colours(o, rng.fork(static_cast<uint64_t>(attempt) + 50));
        if (allowed(o, filter, false)) break;
    }
    o.lightness = 0;
    o.paints.clear();
    o.tilt = 0;
    const Footprint foot = footprint(host), own = footprint(o);
    o.size = host.size * std::clamp(foot.anchor_width * rng.uniform(0.95f, 1.3f), 0.26f, 0.6f) /
             std::max(flat_radius(own), 0.3f);
    o.yaw = host.yaw;
    o.position = host.position + foot.anchor * host.size - Vec3{0, 0, 0.03f};
    return o;
}

void draw_surroundings(SceneSpec& scene, const Settings& s, Rng rng) {
    GroundSpec& g = scene.ground;
    const float kind = rng.uniform();
    if (kind < s.no_ground)
        g.kind = GroundKind::kNone;
    else if (kind < s.no_ground + s.base_plate)
        g.kind = GroundKind::kPlate;
    else if (kind < s.no_ground + s.base_plate + s.endless_plane)
        g.kind = GroundKind::kPlane;
    else
        g.kind = GroundKind::kDisc;
    g.stuff = rng.chance(0.6f) ? GroundStuff::kColour : static_cast<GroundStuff>(rng.between(1, kGroundStuffs - 1));
    const bool muted = rng.chance(0.45f);
    g.colour = colour_out_of(muted ? bit(kGrey) | bit(kBrown) | bit(kGreen) | bit(kWhite) | bit(kBlack) : 0, rng);
    g.size = rng.uniform(1.15f, 2.0f);
    g.aspect = rng.chance(0.5f) ? rng.uniform(0.6f, 1.0f) : 1.0f;
    g.rim = rng.chance(0.35f);
    g.studs = rng.chance(0.4f) && (g.stuff == GroundStuff::kColour || g.stuff == GroundStuff::kBeige);
    g.seed = rng.next();
    BackdropSpec& b = scene.backdrop;
    const bool white = rng.chance(s.white_backdrop);
    const int other = rng.between(1, 3);
    b.kind = white ? BackdropKind::kWhite : static_cast<BackdropKind>(other);
    b.colour = b.kind == BackdropKind::kColour ? rng.below(kColours) : -1;
    b.seed = rng.next();
}

namespace {

// An object beside the main one: with chance `alike` of its colour, if a few draws find one.
ObjectSpec draw_neighbour(Role role, const ObjectSpec& main, const Settings& s, Filter filter, Rng rng) {
    constexpr int kDraws = 24;
    const bool alike = s.alike > 0 && main.colour >= 0 && rng.fork(90).chance(s.alike);
    ObjectSpec neighbour = draw_object(role, s, filter, rng);
    for (int i = 0; alike && neighbour.colour != main.colour && i < kDraws; ++i) {
        neighbour = draw_object(role, s, filter, rng.fork(100 + static_cast<uint64_t>(i)));
    }
    return neighbour;
}

SceneSpec draw_scene(const Settings& s, Filter filter, Rng rng) {
    SceneSpec scene;
    scene.view_seed = rng.next();
    scene.objects.push_back(draw_object(Role::kMain, s, filter, rng.fork(1)));
    const ObjectSpec main = scene.objects[0];
    const float radius = flat_radius(footprint(main)), extra = rng.uniform(), angle = rng.uniform(0, 2 * kPi);
    Rng more = rng.fork(2);
    float taken = radius;
    if (extra < s.several) {
        const int copies = more.between(1, 2);
        for (int i = 0; i < copies; ++i) {
            ObjectSpec copy = main;
            copy.role = Role::kCopy;
            copy.seed = more.next();
            copy.yaw = more.uniform(0, 2 * kPi);
            copy.tilt = 0;
            place_beside(copy, radius, angle + kPi * static_cast<float>(i), more.uniform(0.05f, 0.3f));
            scene.objects.push_back(copy);
        }
        taken = 3 * radius;
    } else if (extra < s.several + s.second_object) {
        const Filter common = filter == Filter::kHeldOut ? Filter::kTrain : filter;
        ObjectSpec second = draw_neighbour(Role::kSecond, main, s, common, more);
        for (int attempt = 1; second.shape == main.shape; ++attempt) {
            second = draw_neighbour(Role::kSecond, main, s, Filter::kTrain, more.fork(static_cast<uint64_t>(attempt)));
        }
        second.size = more.uniform(0.6f, 1.0f);
        place_beside(second, radius, angle, more.uniform(0.05f, 0.3f));
        scene.relation = Relation::kNextTo;
        scene.objects.push_back(second);
        taken = radius + 1.5f * second.size;
    } else if (extra < s.several + s.second_object + s.addition && shape_info(main.shape).holds && main.tilt == 0.0f) {
        scene.objects.push_back(draw_addition(main, s, filter, more));
    }
    Rng props = rng.fork(3);
    const int clutter = props.chance(s.clutter) ? props.between(1, 3) : 0;
    for (int i = 0; i < clutter; ++i) {
        ObjectSpec prop = draw_neighbour(Role::kClutter, main, s, Filter::kTrain, props.fork(static_cast<uint64_t>(i)));
        prop.size = props.uniform(0.15f, 0.45f);
        place_beside(prop, taken, props.uniform(0, 2 * kPi), props.uniform(0.05f, 0.7f));
        scene.objects.push_back(prop);
    }
    draw_surroundings(scene, s, rng.fork(4));
    return scene;
}

Change draw_change(const Settings& s, Rng& rng) {
    float total = 0;
    for (const float w : s.change) total += w;
    float at = rng.uniform() * total;
    for (int i = 0; i < kChanges; ++i) {
        at -= s.change[static_cast<size_t>(i)];
        if (at < 0) return static_cast<Change>(i);
    }
    return Change::kColour;
}

}  // namespace

Pair draw_pair(Rng rng, const Settings& s, Filter filter) {
    for (int attempt = 0; attempt < 500; ++attempt) {
        Rng own = rng.fork(static_cast<uint64_t>(attempt) + 1000);
        Pair pair;
        pair.scene[0] = draw_scene(s, filter, own.fork(1));
        Rng words = own.fork(2);
        pair.plan = draw_plan(words, s);
        Rng kind = own.fork(3);
        pair.change = draw_change(s, kind);
        if (!draw_twin(pair, s, filter, own.fork(4))) continue;
        if (caption(pair.scene[0], pair.plan, s) == caption(pair.scene[1], pair.plan, s)) continue;
        return pair;
    }
    throw std::runtime_error(
        "draw_pair: no pair after 500 draws; the settings' weights of the changes leave nothing possible");
}

}  // namespace fieldgraft::generator
