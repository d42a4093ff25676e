// Random numbers that are the same on every machine: PCG32 (O'Neill 2014, www.pcg-random.org, "PCG-XSH-RR").
// Streams with different `sequence` are independent; nothing in the project uses a global generator.
#pragma once

#include <cstdint>

namespace fieldgraft {

class Random {
  public:
    explicit Random(std::uint64_t seed, std::uint64_t sequence = 0);
    std::uint32_t bits();
    // Uniform in [0, 1), 24 bits.
    float uniform() { return static_cast<float>(bits() >> 8) * 0x1p-24f; }
    float uniform(float low, float high) { return low + (high - low) * uniform(); }
    // Uniform in {0 … n−1} without modulo bias; n ≥ 1.
    std::uint32_t below(std::uint32_t n);
    float normal();

    // The whole state, to be put into a checkpoint and taken back out of it.
    std::uint64_t state() const { return state_; }
    std::uint64_t increment() const { return increment_; }
    void restore(std::uint64_t state, std::uint64_t increment) {
        state_ = state;
        increment_ = increment;
    }

  private:
    std::uint64_t state_ = 0;
    std::uint64_t increment_ = 1;
};

}  // namespace fieldgraft
