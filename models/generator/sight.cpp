#include "models/generator/sight.h"

#include <algorithm>

#include "models/generator/shapes.h"

namespace fieldgraft::generator {
namespace {

// Materials whose look may be called by a colour word.
uint32_t looks_like(int material) {
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

}  // namespace

Sight::Sight(const SceneSpec& spec, const World& world, const Frame& frame)
    : spec_(spec), world_(world), frame_(frame), seen_(world.primitives.size(), 0) {
    for (const int16_t id : frame.visible) {
        if (id >= 0) ++seen_[static_cast<size_t>(id)];
    }
}

bool Sight::matches(const Primitive& p, const Wanted& w) const {
    const WorldObject& o = owner(p);
    if (w.ground) return o.ground;
    if (o.ground) return false;
    if (w.flames) return p.layer == Layer::kFlame;
    if (w.addition && o.role != Role::kAddition) return false;
    if (w.shape >= 0 && o.shape != w.shape) return false;
    if (w.material >= 0 && o.material != w.material) return false;
    if (w.colour >= 0 && o.colour != w.colour) return false;
    if (w.part >= 0 && p.part != w.part) return false;
    if (w.piece_material >= 0 && paint(p).material != w.piece_material && p.layer != Layer::kFlame) return false;
    if (w.piece_colour >= 0 && (paint(p).colour != w.piece_colour || p.layer == Layer::kFlame)) return false;
    return true;
}

bool Sight::exists(const Wanted& w) const {
    return std::any_of(world_.primitives.begin(), world_.primitives.end(),
                       [&](const Primitive& p) { return matches(p, w); });
}

int Sight::samples(const Wanted& w) const {
    int count = 0;
    for (size_t i = 0; i < seen_.size(); ++i) count += matches(world_.primitives[i], w) ? seen_[i] : 0;
    return count;
}

std::vector<uint8_t> Sight::mask(const Wanted& w) const {
    if (w.snow) return frame_.snow;
    std::vector<uint8_t> hit(world_.primitives.size() + 1, 0);
    for (size_t i = 0; i < world_.primitives.size(); ++i) hit[i + 1] = matches(world_.primitives[i], w);
    std::vector<uint8_t> pixels = nothing();
    const int n = 2 * frame_.size;
    for (int y = 0; y < frame_.size; ++y) {
        for (int x = 0; x < frame_.size; ++x) {
            int count = 0;
            for (int k = 0; k < 4; ++k)
                count += hit[static_cast<size_t>(
                    frame_.visible[static_cast<size_t>((2 * y + (k >> 1)) * n + 2 * x + (k & 1))] + 1)];
            pixels[static_cast<size_t>(y * frame_.size + x)] = count >= 2;
        }
    }
    return pixels;
}

int Sight::snow_pixels() const {
    int count = 0;
    for (const uint8_t s : frame_.snow) count += s;
    return count;
}

float Sight::colour_share(const WorldObject& o) const {
    Wanted w{.shape = o.shape, .material = o.material, .colour = o.colour};
    const int all = samples(w);
    w.piece_colour = o.colour;
    return o.colour >= 0 ? static_cast<float>(samples(w)) / static_cast<float>(std::max(1, all)) : 0.0f;
}

Shares Sight::main_shares() const {
    const WorldObject& main = world_.objects[0];
    Wanted own{.shape = main.shape, .material = main.material, .colour = main.colour};
    const auto whole = static_cast<float>(std::max(1, samples(own)));
    Shares shares;
    shares.picture = static_cast<float>(samples(own)) / static_cast<float>(frame_.visible.size());
    shares.objects = static_cast<float>(samples(own)) / static_cast<float>(std::max(1, samples({})));
    shares.colour = colour_share(main);
    own.piece_material = main.material;
    shares.material = static_cast<float>(samples(own)) / whole;
    return shares;
}

std::array<uint64_t, 3> Sight::beside() const {
    std::vector<int> count(world_.objects.size(), 0);
    for (size_t i = 0; i < seen_.size(); ++i) count[static_cast<size_t>(world_.primitives[i].object)] += seen_[i];
    std::array<uint64_t, 3> words{};
    const auto add = [](uint64_t& mask, int word) { mask |= word >= 0 ? uint64_t{1} << word : 0; };
    for (size_t i = 1; i < count.size(); ++i) {
        const WorldObject& o = world_.objects[i];
        if (o.ground || count[i] * 4 < count[0] || count[i] == 0) continue;
        add(words[0], o.shape);
        add(words[1], o.material);
        add(words[2], o.colour);
    }
    return words;
}

std::vector<const Primitive*> Sight::seen(bool by_part) const {
    std::vector<const Primitive*> list;
    for (size_t i = 0; i < seen_.size(); ++i) {
        const Primitive& p = world_.primitives[i];
        if (seen_[i] == 0 || owner(p).ground || p.layer == Layer::kFlame) continue;
        const auto same = [&](const Primitive* q) { return q->object == p.object && (!by_part || q->part == p.part); };
        if (std::none_of(list.begin(), list.end(), same)) list.push_back(&p);
    }
    return list;
}

uint32_t Sight::colours_about() const {
    uint32_t mask = 0;
    for (const Primitive& p : world_.primitives)
        mask |= (paint(p).colour >= 0 ? bit(paint(p).colour) : 0) |
                looks_like(owner(p).ground ? kPlain : paint(p).material);
    for (const ObjectSpec& o : spec_.objects) mask |= o.colour2 >= 0 ? bit(o.colour2) : 0;
    if (spec_.ground.stuff != GroundStuff::kColour)
        mask |= bit(kBrown) | bit(kGrey) | bit(kWhite) | bit(kRed) | bit(kGreen) | bit(kBlack);
    return mask;
}

bool Sight::clash(int colour) const {
    for (const ObjectSpec& o : spec_.objects) {
        if (o.colour2 == colour || (looks_like(o.material) & bit(colour))) return true;
    }
    return spec_.ground.kind != GroundKind::kNone && spec_.ground.colour == colour;
}

}  // namespace fieldgraft::generator
