// An edit's support and smoothness: where g acts at all, and how much it changes over a small step.
//
// Support: the cells among `candidates` where max(1 − e^(−σᵉ δ) ~ σᵉ δ, βσ, βc) > ε at any of 3×3×3 points of the cell
// (corners, edges, faces, centre). Sigmoid and softplus are never 0, so what acts must be cut off somewhere: figures
// are taken after this truncation, whose error per interval is at most ε. Smoothness: mean over points of |g(x) − g(x +
// e)|² over colour and βs, and over 1 − e^(−σᵉ u), u = box edge/128; e uniform in a cube of half-width `distance`.
// Differentiable in g.
#pragma once

#include "core/base/random.h"
#include "core/field/edit_field.h"

namespace fieldgraft {

// candidates R×R×R uint8: f's occupancy for change and remove, with the region where density may appear for add.
// `delta` is the march's interval. The result has the candidates' resolution.
Tensor edit_support(const EditField& edit, const Tensor& candidates, double delta, double epsilon = 1e-3);

// `edit` is g at `positions` (N×3), with its graph. `distance` in model units. Draws 3N numbers. 0 for N = 0.
Tensor jitter_penalty(const EditField& field, const EditSamples& edit, const Tensor& positions, double distance,
                      Random& random);

}  // namespace fieldgraft
