// Procedural surfaces: paint, gold, silver, wood, marble, brick, rust, moss, snow, fire, stripes, dots, as functions of
// a point in the object's own frame. Linear colours. Lengths: object units (an object is about 2 across).
#pragma once

#include "models/generator/world.h"

namespace fieldgraft::generator {

struct Surface {
    Vec3 albedo{0.5f, 0.5f, 0.5f};
    Vec3 emission;
    Vec3 bump;               // added to the normal, in the object's frame
    float specular = 0.04f;  // reflectance at normal incidence
    int sharpness = 4;       // highlight exponent 2^sharpness
    float metal = 0.0f;
    float snow = 0.0f;  // 1 where there is snow
};

// q: point, n: unit normal, both in the object's frame (z up there, too).
Surface surface_at(const Paint& paint, Vec3 q, Vec3 n);

}  // namespace fieldgraft::generator
