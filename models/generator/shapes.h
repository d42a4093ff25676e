// The shapes: what each is called, which parts it has, and how it is built out of primitives.
// Builders work in units of their own, x forward, y left, z up, standing around the origin; the result is scaled so
// that the largest half-extent is 1 and the lowest point is z = 0. A builder draws its random proportions whether or
// not a part is absent or painted, so a twin differs in nothing else.
#pragma once

#include <string_view>
#include <vector>

#include "models/generator/primitives.h"
#include "models/generator/spec.h"
#include "models/generator/vocabulary.h"

namespace fieldgraft::generator {

class Builder {
  public:
    Builder(Rng rng, const std::vector<int>& absent) : rng(rng), absent_(absent) {}

    Primitive* box(int part, Vec3 centre, Vec3 half, const Mat3& rotation = {});
    Primitive* ball(int part, Vec3 centre, Vec3 radii, const Mat3& rotation = {});
    Primitive* ball(int part, Vec3 centre, float radius) { return ball(part, centre, {radius, radius, radius}); }
    Primitive* dome(int part, Vec3 centre, Vec3 radii, const Mat3& rotation = {});
    // Radius r0 at a, r1 at b.
    Primitive* rod(int part, Vec3 a, Vec3 b, float r0, float r1);
    Primitive* rod(int part, Vec3 a, Vec3 b, float r) { return rod(part, a, b, r, r); }
    Primitive* ring(int part, Vec3 centre, Vec3 axis, float major, float minor);
    Primitive* wedge(int part, Vec3 centre, Vec3 half, const Mat3& rotation = {});
    Primitive* gable(int part, Vec3 centre, Vec3 half, const Mat3& rotation = {});
    Primitive* pyramid(int part, Vec3 centre, Vec3 half, const Mat3& rotation = {});
    // A wheel with a hub, axis along y.
    void wheel(int part, Vec3 centre, float radius, float half_width);
    // Small boxes and pegs on the top of a box.
    void greebles(int part, Vec3 centre, Vec3 half, int count);
    // Studs or panel lines on the primitive that was added last.
    void pattern(float spacing);
    // Where a hat sits; without it, the top of the highest primitive.
    void anchor(Vec3 position, float width) {
        anchor_ = position;
        anchor_width_ = width;
    }

    Rng rng;

    struct Result {
        std::vector<Primitive> primitives;
        Vec3 half;  // of the bounding box, after scaling
        Vec3 anchor;
        float anchor_width = 0.5f;
    };
    Result finish();

  private:
    Primitive* add(const Primitive& p);

    const std::vector<int>& absent_;
    std::vector<Primitive> primitives_;
    std::vector<bool> kept_;
    Primitive dropped_;
    Vec3 anchor_;
    float anchor_width_ = 0.0f;
};

// How a part is painted and spoken of. `own`: how often it has a colour of its own when the object is plain;
// `natural`: bit mask of the colours that are likely then (0: any).
struct PartRule {
    int part;
    float own = 0.0f;
    uint32_t natural = 0;
    bool removable = false;
};

struct ShapeInfo {
    std::string_view name, plural;
    std::vector<std::string_view> synonyms;
    std::vector<PartRule> parts;
    void (*build)(Builder&);
    bool tumbles = false;        // may lie in any direction
    bool holds = true;           // things can be put on top of it
    uint32_t usual_colours = 0;  // drawn more often than others
    float weight = 1.0f;
};

int shape_count();
const ShapeInfo& shape_info(int shape);
int shape_named(std::string_view name);  // throws std::invalid_argument

constexpr uint32_t bit(int colour) {
    return 1u << colour;
}

// The lists that the registry is put together from.
std::vector<ShapeInfo> basic_shapes();
void build_bulldozer(Builder& b);
std::vector<ShapeInfo> furniture_shapes();
std::vector<ShapeInfo> vehicle_shapes();
std::vector<ShapeInfo> living_shapes();
std::vector<ShapeInfo> thing_shapes();

}  // namespace fieldgraft::generator
