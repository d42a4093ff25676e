// The generator's own random numbers and value noise (splitmix64): the same everywhere, independent of the standard
// library. Every picture has its own stream, named by (seed, split, index); sub-streams are forked by a tag, so that
// a change in one place of a scene leaves the draws everywhere else as they were.
#pragma once

#include <cstdint>
#include <string_view>

#include "models/generator/vec.h"

namespace fieldgraft::generator {

inline uint64_t mix_bits(uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31);
}

inline uint64_t hash_text(std::string_view text, uint64_t seed = 0) {
    uint64_t h = 0xcbf29ce484222325ULL ^ mix_bits(seed + 0x9e3779b97f4a7c15ULL);
    for (const char c : text) h = (h ^ static_cast<unsigned char>(c)) * 0x100000001b3ULL;
    return mix_bits(h);
}

class Rng {
  public:
    explicit Rng(uint64_t seed) : state_(mix_bits(seed + 0x9e3779b97f4a7c15ULL)) {}
    uint64_t next() { return mix_bits(state_ += 0x9e3779b97f4a7c15ULL); }
    // [0, 1) with 24 bits.
    float uniform() { return static_cast<float>(next() >> 40) * (1.0f / 16777216.0f); }
    float uniform(float lo, float hi) { return lo + (hi - lo) * uniform(); }
    int below(int n) { return static_cast<int>((next() >> 32) * static_cast<uint64_t>(n) >> 32); }
    int between(int lo, int hi) { return lo + below(hi - lo + 1); }
    bool chance(float p) { return uniform() < p; }
    // Sum of three uniforms: about normal, variance 1, bounded by 3.
    float bell() { return (uniform() + uniform() + uniform() - 1.5f) * 2.0f; }
    Rng fork(uint64_t tag) const { return Rng(state_ ^ mix_bits(tag * 0xd6e8feb86659fd93ULL + 1)); }

  private:
    uint64_t state_;
};

// Value noise in [0, 1], period-free, C1 between lattice points.
inline float lattice(int x, int y, int z) {
    uint32_t h = static_cast<uint32_t>(x) * 0x8da6b343u ^ static_cast<uint32_t>(y) * 0xd8163841u ^
                 static_cast<uint32_t>(z) * 0xcb1ab31fu;
    h = (h ^ (h >> 13)) * 0x5bd1e995u;
    h ^= h >> 15;
    return static_cast<float>(h >> 8) * (1.0f / 16777216.0f);
}

inline float noise(Vec3 p) {
    const float fx = std::floor(p.x), fy = std::floor(p.y), fz = std::floor(p.z);
    const int x = static_cast<int>(fx), y = static_cast<int>(fy), z = static_cast<int>(fz);
    const auto fade = [](float t) { return t * t * (3.0f - 2.0f * t); };
    const float u = fade(p.x - fx), v = fade(p.y - fy), w = fade(p.z - fz);
    const float near =
        mix(mix(lattice(x, y, z), lattice(x + 1, y, z), u), mix(lattice(x, y + 1, z), lattice(x + 1, y + 1, z), u), v);
    const float far = mix(mix(lattice(x, y, z + 1), lattice(x + 1, y, z + 1), u),
                          mix(lattice(x, y + 1, z + 1), lattice(x + 1, y + 1, z + 1), u), v);
    return mix(near, far, w);
}

inline float noise2(Vec3 p) {
    return 0.66f * noise(p) + 0.34f * noise(p * 2.13f + Vec3{7.3f, 1.7f, 4.1f});
}

}  // namespace fieldgraft::generator
