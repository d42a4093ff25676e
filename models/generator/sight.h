// What can be told of a rendered picture: which primitives fit a description, how much of them is seen and where, and
// which words could be disputed.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "models/generator/render.h"
#include "models/generator/spec.h"
#include "models/generator/world.h"

namespace fieldgraft::generator {

// What a query asks of a primitive; −1: anything.
struct Wanted {
    int shape = -1, material = -1, colour = -1, part = -1;
    int piece_colour = -1;  // the colour of the piece itself, not of the object it belongs to
    int piece_material = -1;
    bool ground = false, addition = false, snow = false, flames = false;
};

// Of what is seen of the main object: its share of the picture and of all objects, and how much of it has the colour
// and the material that it is called by.
struct Shares {
    float picture = 0, objects = 0, colour = 0, material = 0;
};

class Sight {
  public:
    Sight(const SceneSpec& spec, const World& world, const Frame& frame);

    const WorldObject& owner(const Primitive& p) const { return world_.objects[static_cast<size_t>(p.object)]; }
    const Paint& paint(const Primitive& p) const { return world_.paints[static_cast<size_t>(p.paint)]; }
    bool two_coloured(const Primitive& p) const {
        return paint(p).material == kStriped || paint(p).material == kDotted;
    }

    bool matches(const Primitive& p, const Wanted& w) const;
    // Whether anything in the scene fits, seen or hidden.
    bool exists(const Wanted& w) const;
    // Number of samples (four a pixel) that show it.
    int samples(const Wanted& w) const;
    // Pixels with at least two of their four samples on it; snow is known by pixel.
    std::vector<uint8_t> mask(const Wanted& w) const;
    std::vector<uint8_t> nothing() const {
        return std::vector<uint8_t>(static_cast<size_t>(frame_.size * frame_.size), 0);
    }
    int snow_pixels() const;
    Shares main_shares() const;
    // How much of what is seen of the object is painted in the colour it is called by.
    float colour_share(const WorldObject& o) const;
    // Shapes, materials and colours (bit masks) of the other objects that show at least a quarter of the main one's
    // samples: words that fit the picture as well.
    std::array<uint64_t, 3> beside() const;

    // One seen primitive of each object, or of each part of each object, without ground and flames.
    std::vector<const Primitive*> seen(bool by_part) const;
    // Bit mask of every colour word that something in the scene might be given.
    uint32_t colours_about() const;
    // The colour is also a pattern's second colour or the ground's, or a material looks like it: disputable.
    bool clash(int colour) const;

  private:
    const SceneSpec& spec_;
    const World& world_;
    const Frame& frame_;
    std::vector<int> seen_;
};

}  // namespace fieldgraft::generator
