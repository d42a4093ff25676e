#include "models/generator/compose.h"

#include <stdexcept>

#include "models/generator/shapes.h"
#include "models/generator/world.h"

namespace fieldgraft::generator {
namespace {

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

// Colours of the chosen material; the second one of stripes and dots stands out from the first.
void draw_colours(ObjectSpec& o, Rng rng) {
    o.colour = o.colour2 = -1;
    o.lightness = 0;
    constexpr float kChance[kMaterials] = {1, 0, 0, 0.5f, 0, 0, 0, 0.5f, 0.45f, 0.8f, 0.5f, 1, 1};
    const uint32_t usual = shape_info(o.shape).usual_colours;
    const bool from_usual = rng.chance(0.25f);
    const int colour = colour_out_of(usual && from_usual ? usual : 0, rng);
    if (rng.chance(kChance[o.material])) o.colour = colour;
    const uint32_t contrast = bit(kBlack) | bit(kWhite) | bit(kYellow) | bit(kRed) | bit(kBlue);
    const int second = colour_out_of((rng.chance(0.6f) ? bit(kWhite) : contrast) & ~bit(colour), rng);
    if (o.material == kStriped || o.material == kDotted) o.colour2 = second != colour ? second : (colour == kWhite ? kRed : kWhite);
    const bool shaded = rng.chance(0.1f);
    const uint32_t dark = bit(kRed) | bit(kGreen) | bit(kBlue) | bit(kPurple) | bit(kGrey), light = bit(kGreen) | bit(kBlue) | bit(kPurple);
    const bool lighter = rng.chance(0.4f);
    if (shaded && o.material == kPlain && (bit(colour) & (lighter ? light : dark))) o.lightness = lighter ? 1 : -1;
}

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

float flat_radius(const Footprint& f) { return std::max(f.half.x, f.half.y); }

// Beside the main object, near enough to be seen with it.
void place_beside(ObjectSpec& o, float main_radius, float angle, float gap) {
    const float r = main_radius + flat_radius(footprint(o)) * o.size + gap;
    o.position = {r * cosine(angle), r * sine(angle), 0};
}

ObjectSpec draw_addition(const ObjectSpec& host, const Settings& s, Filter filter, Rng rng) {
    static const int kinds[] = {shape_named("hat"), shape_named("hat"), shape_named("hat"), shape_named("crown"), shape_named("ball"), shape_named("cube"), shape_named("cone"), shape_named("flower")};
    ObjectSpec o = draw_object(Role::kAddition, s, Filter::kTrain, rng.fork(1));
    const int shape = kinds[rng.below(8)];
    for (int attempt = 0; attempt < 200; ++attempt) {
        o.shape = shape;
        o.material = rng.chance(0.75f) ? static_cast<int>(kPlain) : (rng.chance(0.5f) ? static_cast<int>(kGold) : static_cast<int>(kSilver));
        draw_colours(o, rng.fork(static_cast<uint64_t>(attempt) + 50));
        if (allowed(o, filter, false)) break;
    }
    o.lightness = 0;
    o.paints.clear();
    o.tilt = 0;
    const Footprint foot = footprint(host), own = footprint(o);
    o.size = host.size * std::clamp(foot.anchor_width * rng.uniform(0.95f, 1.3f), 0.26f, 0.6f) / std::max(flat_radius(own), 0.3f);
    o.yaw = host.yaw;
    o.position = host.position + foot.anchor * host.size - Vec3{0, 0, 0.03f};
    return o;
}

void draw_surroundings(SceneSpec& scene, const Settings& s, Rng rng) {
    GroundSpec& g = scene.ground;
    const float kind = rng.uniform();
    if (kind < s.no_ground) g.kind = GroundKind::kNone;
    else if (kind < s.no_ground + s.base_plate) g.kind = GroundKind::kPlate;
    else if (kind < s.no_ground + s.base_plate + s.endless_plane) g.kind = GroundKind::kPlane;
    else g.kind = GroundKind::kDisc;
    g.stuff = rng.chance(0.6f) ? GroundStuff::kColour : static_cast<GroundStuff>(rng.between(1, kGroundStuffs - 1));
    const bool muted = rng.chance(0.45f);
    g.colour = colour_out_of(muted ? bit(kGrey) | bit(kBrown) | bit(kGreen) | bit(kWhite) | bit(kBlack) : 0, rng);
    g.size = rng.uniform(1.15f, 2.0f);
    g.studs = rng.chance(0.3f) && g.stuff == GroundStuff::kColour;
    g.seed = rng.next();
    BackdropSpec& b = scene.backdrop;
    const bool white = rng.chance(s.white_backdrop);
    const int other = rng.between(1, 3);
    b.kind = white ? BackdropKind::kWhite : static_cast<BackdropKind>(other);
    b.colour = b.kind == BackdropKind::kColour ? rng.below(kColours) : -1;
    b.seed = rng.next();
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
        ObjectSpec second = draw_object(Role::kSecond, s, filter == Filter::kHeldOut ? Filter::kTrain : filter, more);
        for (int attempt = 1; second.shape == main.shape; ++attempt) {
            second = draw_object(Role::kSecond, s, Filter::kTrain, more.fork(static_cast<uint64_t>(attempt)));
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
        ObjectSpec prop = draw_object(Role::kClutter, s, Filter::kTrain, props.fork(static_cast<uint64_t>(i)));
        prop.size = props.uniform(0.15f, 0.45f);
        place_beside(prop, taken, props.uniform(0, 2 * kPi), props.uniform(0.05f, 0.7f));
        scene.objects.push_back(prop);
    }
    draw_surroundings(scene, s, rng.fork(4));
    return scene;
}

// Parts that the main object's geometry really has.
std::vector<PartRule> present_parts(const ObjectSpec& o) {
    Builder builder(Rng(o.seed).fork(11), o.absent);
    shape_info(o.shape).build(builder);
    const Builder::Result built = builder.finish();
    std::vector<PartRule> list;
    for (const PartRule& rule : shape_info(o.shape).parts) {
        if (std::any_of(built.primitives.begin(), built.primitives.end(), [&](const Primitive& p) { return p.part == rule.part; })) list.push_back(rule);
    }
    return list;
}

// Applies a change to the main object and its copies.
template <typename Edit>
void edit_main(SceneSpec& scene, const Edit& edit) {
    for (ObjectSpec& o : scene.objects) {
        if (o.role == Role::kMain || o.role == Role::kCopy) edit(o);
    }
}

bool twin_of_kind(Pair& pair, const Settings& s, Filter filter, Rng rng) {
    SceneSpec &first = pair.scene[0], &second = pair.scene[1];
    second = first;
    const ObjectSpec& main = first.objects[0];
    switch (pair.change) {
        case Change::kColour: {
            if (main.colour < 0) return false;
            for (int attempt = 0; attempt < 60; ++attempt) {
                ObjectSpec o = main;
                o.colour = rng.below(kColours);
                if (o.colour == main.colour || o.colour == main.colour2 || !allowed(o, filter, true)) continue;
                edit_main(second, [&](ObjectSpec& e) { e.colour = o.colour; });
                edit_main(first, [](ObjectSpec& e) { e.lightness = 0; });
                edit_main(second, [](ObjectSpec& e) { e.lightness = 0; });
                pair.plan.colour = true;
                return true;
            }
            return false;
        }
        case Change::kMaterial: {
            for (int attempt = 0; attempt < 60; ++attempt) {
                ObjectSpec o = main;
                o.material = rng.below(kMaterials);
                if (o.material == main.material || (o.material == kPlain && main.colour < 0)) continue;
                o.lightness = 0;
                if (!takes_colour(o.material)) o.colour = -1;
                if ((o.material == kStriped || o.material == kDotted) && o.colour < 0) o.colour = rng.below(kColours);
                const bool two = o.material == kStriped || o.material == kDotted;
                if (two && o.colour2 < 0) o.colour2 = o.colour == kWhite ? kRed : kWhite;
                if (!two) o.colour2 = -1;
                if (!allowed(o, filter, true)) continue;
                edit_main(second, [&](ObjectSpec& e) {
                    e.material = o.material;
                    e.colour = o.colour;
                    e.colour2 = o.colour2;
                    e.lightness = 0;
                });
                edit_main(first, [](ObjectSpec& e) { e.lightness = 0; });
                pair.plan.material = true;
                pair.plan.colour = pair.plan.colour || o.material == kPlain || main.material == kPlain;
                return true;
            }
            return false;
        }
        case Change::kShape: {
            if (std::any_of(first.objects.begin(), first.objects.end(), [](const ObjectSpec& o) { return o.role == Role::kAddition; })) return false;
            for (int attempt = 0; attempt < 60; ++attempt) {
                ObjectSpec o = main;
                o.shape = draw_shape(rng);
                bool clash = o.shape == main.shape || !allowed(o, filter, true);
                for (const ObjectSpec& other : first.objects) clash = clash || (other.role == Role::kSecond && other.shape == o.shape);
                if (clash) continue;
                edit_main(second, [&](ObjectSpec& e) {
                    e.shape = o.shape;
                    e.tilt = 0;
                    e.absent.clear();
                    draw_paints(e, s, Rng(main.seed).fork(99));
                    for (PartPaint& p : e.paints) p.said = false;
                });
                edit_main(first, [](ObjectSpec& e) {
                    for (PartPaint& p : e.paints) p.said = false;
                });
                return true;
            }
            return false;
        }
        case Change::kAddition: {
            const bool has = std::any_of(first.objects.begin(), first.objects.end(), [](const ObjectSpec& o) { return o.role == Role::kAddition || o.role == Role::kCopy; });
            const bool holds = shape_info(main.shape).holds && main.tilt == 0.0f && !has;
            if (!holds || rng.chance(0.3f)) {  // snow or fire on it
                if (main.material != kPlain) return false;
                ObjectSpec o = main;
                o.material = rng.chance(0.5f) ? kSnow : kBurning;
                o.lightness = 0;
                if (!allowed(o, filter, true)) return false;
                edit_main(second, [&](ObjectSpec& e) {
                    e.material = o.material;
                    e.lightness = 0;
                });
                edit_main(first, [](ObjectSpec& e) { e.lightness = 0; });
                pair.plan.material = pair.plan.suffix = true;
                return true;
            }
            second.objects.push_back(draw_addition(main, s, filter, rng.fork(7)));
            return true;
        }
        case Change::kRemoval: {
            std::vector<PartRule> parts = present_parts(main);
            std::erase_if(parts, [](const PartRule& r) { return !r.removable; });
            const bool copies = std::any_of(first.objects.begin(), first.objects.end(), [](const ObjectSpec& o) { return o.role == Role::kCopy || o.role == Role::kAddition; });
            if (parts.empty() || copies) return false;
            const int part = parts[static_cast<size_t>(rng.below(static_cast<int>(parts.size())))].part;
            edit_main(first, [&](ObjectSpec& e) {
                for (PartPaint& p : e.paints) p.said = p.said && p.part != part;
            });
            second = first;
            edit_main(second, [&](ObjectSpec& e) { e.absent.push_back(part); });
            pair.plan.with_part = rng.chance(0.6f) ? part : -1;
            return true;
        }
        case Change::kGround: {
            SceneSpec other = first;
            for (int attempt = 0; attempt < 20; ++attempt) {
                draw_surroundings(other, s, rng.fork(static_cast<uint64_t>(attempt)));
                const bool backdrop = first.ground.kind == GroundKind::kNone && rng.chance(0.4f);
                if (backdrop) {
                    if (other.backdrop.kind == first.backdrop.kind && other.backdrop.colour == first.backdrop.colour) continue;
                    if (other.backdrop.kind > BackdropKind::kColour || first.backdrop.kind > BackdropKind::kColour) continue;
                    if (other.backdrop.colour == kWhite || first.backdrop.colour == kWhite) continue;
                    second.backdrop = other.backdrop;
                } else {
                    if (other.ground.kind == GroundKind::kNone) continue;
                    if (first.ground.kind != GroundKind::kNone) {
                        other.ground.kind = first.ground.kind;
                        other.ground.size = first.ground.size;
                        if (other.ground.stuff == first.ground.stuff && (other.ground.stuff != GroundStuff::kColour || other.ground.colour == first.ground.colour)) continue;
                    }
                    second.ground = other.ground;
                }
                pair.plan.ground = pair.plan.backdrop = true;
                return true;
            }
            return false;
        }
        case Change::kPartPaint: {
            const std::vector<PartRule> parts = present_parts(main);
            if (parts.empty()) return false;
            const int part = parts[static_cast<size_t>(rng.below(static_cast<int>(parts.size())))].part;
            const int before = rng.below(kColours), after = (before + rng.between(1, kColours - 1)) % kColours;
            const auto repaint = [part](int colour) {
                return [part, colour](ObjectSpec& e) {
                    std::erase_if(e.paints, [part](const PartPaint& p) { return p.part == part; });
                    e.paints.push_back({part, colour, true});
                };
            };
            edit_main(first, repaint(before));
            second = first;
            edit_main(second, repaint(after));
            return true;
        }
    }
    return false;
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
        if (!twin_of_kind(pair, s, filter, own.fork(4))) continue;
        if (caption(pair.scene[0], pair.plan, s) == caption(pair.scene[1], pair.plan, s)) continue;
        return pair;
    }
    throw std::runtime_error("draw_pair: no pair after 500 draws; the settings' weights of the changes leave nothing possible");
}

}  // namespace fieldgraft::generator
