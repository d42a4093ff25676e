// Pairs of captioned pictures, numbered from 0: pair i of a (seed, split, settings) is the same bytes whatever was
// asked for before and on however many threads. Splits: "train" and "judge_train" (and "validation", which is drawn
// like them) never show a held-out combination; "heldout" has held-out main objects only.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "models/generator/compose.h"
#include "models/generator/queries.h"

namespace fieldgraft::generator {

struct Picture {
    Frame frame;
    std::string caption, spec;
    std::array<int16_t, 3> said{}, truth{};  // shape, material, colour of the main object; −1: not said, none
    Shares shares;                           // of what is seen of the main object
    std::array<uint64_t, 3> beside{};  // shape, material, colour words of the other clearly visible objects, as bits
    std::vector<Query> queries;        // kQueries of them
};

struct PicturePair {
    Change change = Change::kColour;
    Picture pictures[2];
};

class Generator {
  public:
    // Throws std::invalid_argument for an unknown split, a size outside 16 to 512 or bad settings.
    Generator(uint64_t seed, const std::string& split, int size, const std::string& settings_json);
    PicturePair make(uint64_t index) const;
    int size() const { return size_; }
    const Settings& settings() const { return settings_; }

  private:
    // Draws and renders one candidate; false if the main object or the change is hardly visible.
    bool try_make(Rng rng, bool last, PicturePair& result) const;
    // Takes words out of the plan that the pictures do not bear out; false where the change hangs on them.
    bool only_what_shows(Pair& pair, const PicturePair& pictures) const;
    void describe(const Pair& pair, int k, const Sight& sight, Rng rng, Picture& picture) const;

    Rng stream_;
    Filter filter_;
    int size_;
    Settings settings_;
};

}  // namespace fieldgraft::generator
