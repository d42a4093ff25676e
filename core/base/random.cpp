#include "core/base/random.h"

#include <bit>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace fieldgraft {

Random::Random(std::uint64_t seed, std::uint64_t sequence) : increment_((sequence << 1) | 1) {
    bits();
    state_ += seed;
    bits();
}

std::uint32_t Random::bits() {
    const std::uint64_t old = state_;
    state_ = old * 6364136223846793005ULL + increment_;
    const auto shifted = static_cast<std::uint32_t>(((old >> 18) ^ old) >> 27);
    return std::rotr(shifted, static_cast<int>(old >> 59));
}

std::uint32_t Random::below(std::uint32_t n) {
    if (n == 0) throw std::invalid_argument("Random::below: n is 0, must be at least 1");
    // Values under 2³² mod n would make the small remainders likelier: draw again.
    const std::uint32_t threshold = (0u - n) % n;
    for (;;) {
        const std::uint32_t value = bits();
        if (value >= threshold) return value % n;
    }
}

float Random::normal() {
    // Box–Muller, one of the pair thrown away so that the state is the two words alone. 1 − u is in (0, 1].
    const double radius = std::sqrt(-2.0 * std::log(1.0 - static_cast<double>(uniform())));
    return static_cast<float>(radius * std::cos(2.0 * std::numbers::pi * static_cast<double>(uniform())));
}

}  // namespace fieldgraft
