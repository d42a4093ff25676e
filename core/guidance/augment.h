// Random views of a picture before it is embedded: DiffAugment (Zhao et al. 2020: brightness, saturation, contrast,
// translation, cutout), then a random perspective (Blending-NeRF, sec. 4.2 and B). One set of parameters is drawn per
// optimisation step and applied to the original, the edit and the blended picture alike, or their difference means
// nothing.
//
// 1×3×S×S (or 3×S×S) → N×3×S×S; copy 0 is the picture itself, untouched. Lengths are shares of S, so one set serves
// pictures of any size (translation and cutout are whole pixels: rounded from the share). What leaves the frame or is
// cut out shows `fill`. In order, with m_c = mean over a pixel's channels and m = mean over the picture:
//   x + b;   (x − m_c)·s + m_c;   (x − m)·k + m;   shift;   cutout;   perspective (bilinear, homography of the moved
//   corners).
// b ∈ ±brightness, s ∈ 1 ± saturation, k ∈ 1 ± contrast. Values may leave [0, 1]; they are not clamped (a clamp would
// cut gradients). Differentiable in the picture; the parameters are constants. float32 or float64.
#pragma once

#include <array>
#include <vector>

#include "core/base/random.h"
#include "core/base/torch.h"
#include "core/guidance/config.h"

namespace fieldgraft {

struct AugmentSettings {
    int copies = 24;  // with the untouched one
    ColourRanges colour{};
    double translation = 0.125;  // at most this share of S each way
    double cutout = 0.5;         // side of the square cut out; 0: none
    double perspective = 0.4;    // each corner moves inwards by at most half this share of S; 0: none
    double perspective_chance = 0.5;
};

// One copy's parameters; as constructed they change nothing.
struct Augmentation {
    double brightness = 0, saturation = 1, contrast = 1;
    std::array<double, 2> shift{};      // x, y
    double cutout = 0;                  // side
    std::array<double, 2> cutout_at{};  // centre x, y
    // Where the corners (0,0), (1,0), (1,1), (0,1) of the picture go.
    std::array<std::array<double, 2>, 4> corners{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
    bool warps() const;
    bool operator==(const Augmentation&) const = default;
};

// settings.copies entries, the first one neutral. Throws std::invalid_argument for settings out of range.
std::vector<Augmentation> draw_augmentations(const AugmentSettings& settings, Random& random);

// fill: a colour (3). The first entry's copy is exact if it is neutral. Throws std::invalid_argument.
Tensor augment(const Tensor& image, const std::vector<Augmentation>& augmentations, const Tensor& fill);

// The homography, row-major 3×3, that takes a point of the output (unit square) to the picture's (unit square) when its
// corners have been moved as given (Heckbert 1989, "Fundamentals of Texture Mapping and Image Warping", section 2.2.3).
std::array<double, 9> corner_homography(const std::array<std::array<double, 2>, 4>& corners);

}  // namespace fieldgraft
