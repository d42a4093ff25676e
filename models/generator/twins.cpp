#include "models/generator/draw.h"
#include "models/generator/shapes.h"
#include "models/generator/vocabulary.h"

namespace fieldgraft::generator {
namespace {

constexpr int kAttempts = 60;

// Applies a change to the main object and its copies.
template <typename Edit>
void edit_main(SceneSpec& scene, const Edit& edit) {
    for (ObjectSpec& o : scene.objects) {
        if (o.role == Role::kMain || o.role == Role::kCopy) edit(o);
    }
}

// "Light" and "dark" hold for one colour and material: twins that differ in these do without.
void forget_lightness(Pair& pair) {
    for (SceneSpec& scene : pair.scene) edit_main(scene, [](ObjectSpec& e) { e.lightness = 0; });
}

bool has_role(const SceneSpec& scene, Role role) {
    return std::any_of(scene.objects.begin(), scene.objects.end(),
                       [role](const ObjectSpec& o) { return o.role == role; });
}

// Parts that the object's geometry really has.
std::vector<PartRule> present_parts(const ObjectSpec& o) {
    Builder builder(Rng(o.seed).fork(11), o.absent);
    shape_info(o.shape).build(builder);
    const Builder::Result built = builder.finish();
    std::vector<PartRule> list;
    for (const PartRule& rule : shape_info(o.shape).parts) {
        const auto is_it = [&](const Primitive& p) { return p.part == rule.part; };
        if (std::any_of(built.primitives.begin(), built.primitives.end(), is_it)) list.push_back(rule);
    }
    return list;
}

bool change_colour(Pair& pair, Filter filter, Rng& rng) {
    const ObjectSpec& main = pair.scene[0].objects[0];
    if (main.colour < 0) return false;
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
        ObjectSpec o = main;
        o.colour = rng.below(kColours);
        if (o.colour == main.colour || o.colour == main.colour2 || !allowed(o, filter, true)) continue;
        edit_main(pair.scene[1], [&](ObjectSpec& e) { e.colour = o.colour; });
        forget_lightness(pair);
        pair.plan.colour = true;
        return true;
    }
    return false;
}

bool change_material(Pair& pair, Filter filter, Rng& rng) {
    const ObjectSpec& main = pair.scene[0].objects[0];
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
        ObjectSpec o = main;
        o.material = rng.below(kMaterials);
        if (o.material == main.material || (o.material == kPlain && main.colour < 0)) continue;
        const bool two = o.material == kStriped || o.material == kDotted;
        if (!takes_colour(o.material)) o.colour = -1;
        if (two && o.colour < 0) o.colour = rng.below(kColours);
        if (two && o.colour2 < 0) o.colour2 = o.colour == kWhite ? kRed : kWhite;
        if (!two) o.colour2 = -1;
        if (!allowed(o, filter, true)) continue;
        edit_main(pair.scene[1], [&](ObjectSpec& e) {
            e.material = o.material;
            e.colour = o.colour;
            e.colour2 = o.colour2;
        });
        forget_lightness(pair);
        pair.plan.material = true;
        pair.plan.colour = pair.plan.colour || o.material == kPlain || main.material == kPlain;
        return true;
    }
    return false;
}

bool change_shape(Pair& pair, const Settings& s, Filter filter, Rng& rng) {
    const SceneSpec& first = pair.scene[0];
    if (has_role(first, Role::kAddition)) return false;
    const ObjectSpec main = first.objects[0];
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
        ObjectSpec o = main;
        o.shape = draw_shape(rng);
        bool clash = o.shape == main.shape || !allowed(o, filter, true);
        for (const ObjectSpec& other : first.objects)
            clash = clash || (other.role == Role::kSecond && other.shape == o.shape);
        if (clash) continue;
        edit_main(pair.scene[1], [&](ObjectSpec& e) {
            e.shape = o.shape;
            e.tilt = 0;
            e.absent.clear();
            draw_paints(e, s, Rng(main.seed).fork(99));
        });
        for (SceneSpec& scene : pair.scene) {
            edit_main(scene, [](ObjectSpec& e) {
                for (PartPaint& p : e.paints) p.said = false;
            });
        }
        return true;
    }
    return false;
}

bool add_something(Pair& pair, const Settings& s, Filter filter, Rng& rng) {
    const ObjectSpec main = pair.scene[0].objects[0];
    const bool busy = has_role(pair.scene[0], Role::kAddition) || has_role(pair.scene[0], Role::kCopy);
    if (shape_info(main.shape).holds && main.tilt == 0.0f && !busy && rng.chance(0.7f)) {
        pair.scene[1].objects.push_back(draw_addition(main, s, filter, rng.fork(7)));
        return true;
    }
    // Snow or fire on it.
    if (main.material != kPlain) return false;
    ObjectSpec o = main;
    o.material = rng.chance(0.5f) ? kSnow : kBurning;
    if (!allowed(o, filter, true)) return false;
    edit_main(pair.scene[1], [&](ObjectSpec& e) { e.material = o.material; });
    forget_lightness(pair);
    pair.plan.material = pair.plan.suffix = true;
    return true;
}

bool remove_part(Pair& pair, Rng& rng) {
    std::vector<PartRule> parts = present_parts(pair.scene[0].objects[0]);
    std::erase_if(parts, [](const PartRule& r) { return !r.removable; });
    if (parts.empty() || has_role(pair.scene[0], Role::kCopy) || has_role(pair.scene[0], Role::kAddition)) return false;
    const int part = parts[static_cast<size_t>(rng.below(static_cast<int>(parts.size())))].part;
    for (SceneSpec& scene : pair.scene) {
        edit_main(scene, [&](ObjectSpec& e) {
            for (PartPaint& p : e.paints) p.said = p.said && p.part != part;
        });
    }
    edit_main(pair.scene[1], [&](ObjectSpec& e) { e.absent.push_back(part); });
    pair.plan.with_part = rng.chance(0.6f) ? part : -1;
    return true;
}

bool nameable(const BackdropSpec& b) {
    return b.kind == BackdropKind::kWhite || (b.kind == BackdropKind::kColour && b.colour != kWhite);
}

bool change_backdrop(Pair& pair, const BackdropSpec& other) {
    const BackdropSpec& now = pair.scene[0].backdrop;
    if (!nameable(now) || !nameable(other) || (now.kind == other.kind && now.colour == other.colour)) return false;
    pair.scene[1].backdrop = other;
    return true;
}

bool change_plate(Pair& pair, GroundSpec other) {
    const GroundSpec& now = pair.scene[0].ground;
    if (other.kind == GroundKind::kNone) return false;
    if (now.kind != GroundKind::kNone) {
        other.kind = now.kind;
        other.size = now.size;
        other.aspect = now.aspect;
        const bool same_colour = other.stuff != GroundStuff::kColour || other.colour == now.colour;
        if (other.stuff == now.stuff && same_colour) return false;
    }
    pair.scene[1].ground = other;
    return true;
}

bool change_ground(Pair& pair, const Settings& s, Rng& rng) {
    for (int attempt = 0; attempt < 20; ++attempt) {
        SceneSpec other = pair.scene[0];
        draw_surroundings(other, s, rng.fork(static_cast<uint64_t>(attempt)));
        const bool backdrop = pair.scene[0].ground.kind == GroundKind::kNone && rng.chance(0.4f);
        if (!(backdrop ? change_backdrop(pair, other.backdrop) : change_plate(pair, other.ground))) continue;
        pair.plan.ground = pair.plan.backdrop = true;
        return true;
    }
    return false;
}

bool repaint_part(Pair& pair, Rng& rng) {
    std::vector<PartRule> parts = present_parts(pair.scene[0].objects[0]);
    // The parts that make up most of the object keep its colour.
    std::erase_if(parts, [](const PartRule& r) { return r.own < 0.08f; });
    if (parts.empty()) return false;
    const int part = parts[static_cast<size_t>(rng.below(static_cast<int>(parts.size())))].part;
    const int before = rng.below(kColours), after = (before + rng.between(1, kColours - 1)) % kColours;
    for (const int k : {0, 1}) {
        edit_main(pair.scene[k], [&](ObjectSpec& e) {
            std::erase_if(e.paints, [part](const PartPaint& p) { return p.part == part; });
            e.paints.push_back({part, k == 0 ? before : after, true});
        });
    }
    return true;
}

}  // namespace

bool draw_twin(Pair& pair, const Settings& s, Filter filter, Rng rng) {
    pair.scene[1] = pair.scene[0];
    switch (pair.change) {
        case Change::kColour:
            return change_colour(pair, filter, rng);
        case Change::kMaterial:
            return change_material(pair, filter, rng);
        case Change::kShape:
            return change_shape(pair, s, filter, rng);
        case Change::kAddition:
            return add_something(pair, s, filter, rng);
        case Change::kRemoval:
            return remove_part(pair, rng);
        case Change::kGround:
            return change_ground(pair, s, rng);
        case Change::kPartPaint:
            return repaint_part(pair, rng);
    }
    return false;
}

}  // namespace fieldgraft::generator
