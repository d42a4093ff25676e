#include "models/generator/world.h"

#include "models/generator/shapes.h"

namespace fieldgraft::generator {
namespace {

Vec3 linear(Vec3 encoded) {
    return encoded * encoded;
}

Paint make_paint(int material, int colour, int colour2, int lightness, Rng rng) {
    Paint p;
    p.material = material;
    p.colour = colour;
    Rng tint = rng.fork(1);
    const Vec3 base = colour >= 0 ? sample_colour(colour, lightness, tint) : Vec3{0.5f, 0.5f, 0.5f};
    p.base = linear(base);
    Rng second = rng.fork(2);
    if (colour2 >= 0) p.second = linear(sample_colour(colour2, 0, second));
    Rng texture = rng.fork(3);
    p.scale = texture.uniform(0.8f, 1.25f);
    p.amount = texture.uniform(0.0f, 1.0f);
    p.gloss = texture.uniform(0.0f, 1.0f);
    p.axis = texture.chance(0.55f) ? 2 : texture.below(2);
    p.offset = {texture.uniform(0, 50), texture.uniform(0, 50), texture.uniform(0, 50)};
    return p;
}

Mat3 object_rotation(const ObjectSpec& o) {
    return rotation_z(o.yaw) * rotation_x(o.tilt);
}

void add_flames(World& world, const std::vector<Primitive>& body, int16_t object, int16_t paint, float size, Rng rng) {
    const int count = rng.between(12, 22);
    for (int i = 0; i < count; ++i) {
        const Primitive& host = body[static_cast<size_t>(rng.below(static_cast<int>(body.size())))];
        const Vec3 bound = world_bound(host);
        const float w = size * rng.uniform(0.09f, 0.2f), h = w * rng.uniform(1.6f, 3.2f);
        Primitive flame;
        flame.solid = Solid::kSphere;
        flame.layer = Layer::kFlame;
        flame.centre = host.centre + Vec3{bound.x * rng.uniform(-0.9f, 0.9f), bound.y * rng.uniform(-0.9f, 0.9f),
                                          bound.z * rng.uniform(0.1f, 1.0f) + h * 0.35f};
        flame.half = {w, w, h};
        flame.rotation = rotation_x(rng.uniform(-0.2f, 0.2f)) * rotation_y(rng.uniform(-0.2f, 0.2f));
        flame.object = object;
        flame.part = kFlames;
        flame.paint = paint;
        flame.shade = rng.uniform(0.0f, 1.0f);
        world.primitives.push_back(flame);
    }
}

// Appends the object's paints; returns, for each part, the index of its paint. The first paint is the main one.
std::vector<int16_t> add_paints(World& world, const ObjectSpec& spec) {
    const auto main_paint = static_cast<int16_t>(world.paints.size());
    const Rng paint_rng = Rng(spec.seed).fork(12);
    world.paints.push_back(make_paint(spec.material, spec.colour, spec.colour2, spec.lightness, paint_rng));
    std::vector<int16_t> part_paint(kParts, main_paint);
    for (const PartPaint& p : spec.paints) {
        part_paint[static_cast<size_t>(p.part)] = static_cast<int16_t>(world.paints.size());
        // Rust, moss, snow and fire cover the parts too; all else gives way to plain paint.
        const bool cover = spec.material >= kRusty && spec.material <= kBurning;
        Paint paint = make_paint(cover ? spec.material : kPlain, p.colour, -1, 0,
                                 paint_rng.fork(100 + static_cast<uint64_t>(p.part)));
        paint.amount = world.paints[static_cast<size_t>(main_paint)].amount;
        world.paints.push_back(paint);
    }
    return part_paint;
}

void add_object(World& world, const ObjectSpec& spec) {
    const ShapeInfo& info = shape_info(spec.shape);
    Builder builder(Rng(spec.seed).fork(11), spec.absent);
    info.build(builder);
    const Builder::Result built = builder.finish();

    WorldObject object;
    object.role = spec.role;
    object.shape = spec.shape;
    object.material = spec.material;
    object.colour = spec.colour;
    object.position = spec.position;
    object.rotation = object_rotation(spec);
    object.size = spec.size;
    object.half = built.half;
    const auto index = static_cast<int16_t>(world.objects.size());
    world.objects.push_back(object);

    const auto main_paint = static_cast<int16_t>(world.paints.size());
    const std::vector<int16_t> part_paint = add_paints(world, spec);
    // A tilted object is lifted so that it stands on the ground.
    const Vec3 middle{0, 0, built.half.z};
    std::vector<Primitive> body;
    for (Primitive p : built.primitives) {
        p.centre = object.position + (object.rotation * (p.centre - middle) + middle) * spec.size;
        p.half = p.half * spec.size;
        p.pattern *= spec.size;
        p.rotation = object.rotation * p.rotation;
        p.object = index;
        p.paint = part_paint[static_cast<size_t>(p.part)];
        p.layer = world.paints[static_cast<size_t>(p.paint)].material == kGlass ? Layer::kGlass : Layer::kOpaque;
        body.push_back(p);
    }
    world.primitives.insert(world.primitives.end(), body.begin(), body.end());
    if (spec.material == kBurning && !body.empty()) {
        add_flames(world, body, index, main_paint, spec.size, Rng(spec.seed).fork(13));
    }
}

// Planks and blocks of uneven length along the edges of a plate, in a darker tone or in brown.
void add_rim(World& world, const GroundSpec& ground, const Primitive& plate) {
    Rng rng = Rng(ground.seed).fork(22);
    Paint paint = world.paints[static_cast<size_t>(plate.paint)];
    if (rng.chance(0.6f)) {
        Rng tint = rng.fork(1);
        paint.base = linear(sample_colour(kBrown, 0, tint));
        paint.material = kPlain;
    }
    const auto index = static_cast<int16_t>(world.paints.size());
    world.paints.push_back(paint);
    for (int side = 0; side < 4; ++side) {
        const float along = side < 2 ? plate.half.x : plate.half.y, across = side < 2 ? plate.half.y : plate.half.x;
        for (float at = -along; at < along;) {
            const float length = rng.uniform(0.15f, 0.5f), width = rng.uniform(0.05f, 0.16f),
                        step = std::min(length, along - at);
            Primitive block = plate;
            block.solid = Solid::kBox;
            block.paint = index;
            block.pattern = 0.0f;
            block.shade = rng.uniform(0.55f, 1.0f);
            const float u = at + 0.5f * step, v = (side & 1 ? 1.0f : -1.0f) * (across - 0.4f * width);
            block.centre = side < 2 ? Vec3{u, v, -0.03f} : Vec3{v, u, -0.03f};
            block.half = side < 2 ? Vec3{0.5f * step, width, 0.06f} : Vec3{width, 0.5f * step, 0.06f};
            world.primitives.push_back(block);
            at += length;
        }
    }
}

void add_ground(World& world, const GroundSpec& ground) {
    if (ground.kind == GroundKind::kNone) return;
    WorldObject object;
    object.ground = true;
    object.role = Role::kClutter;
    object.colour = ground.stuff == GroundStuff::kColour ? ground.colour : -1;
    Primitive p;
    p.object = static_cast<int16_t>(world.objects.size());
    p.part = kBase;
    p.paint = static_cast<int16_t>(world.paints.size());
    const float thick = 0.06f;
    if (ground.kind == GroundKind::kPlane) {
        p.solid = Solid::kPlane;
    } else {
        p.solid = ground.kind == GroundKind::kPlate ? Solid::kBox : Solid::kFrustum;
        p.centre = {0, 0, -thick};
        p.half = {ground.size, ground.size * ground.aspect, thick};
        if (ground.studs) p.pattern = 0.11f;
    }
    world.objects.push_back(object);
    Paint paint =
        make_paint(kPlain, ground.stuff == GroundStuff::kColour ? ground.colour : -1, -1, 0, Rng(ground.seed).fork(21));
    paint.ground_stuff = true;
    constexpr int kStuffs[kGroundStuffs] = {kPlain, kWood, kMarble, kBrick, kMossy, kSnow, kStriped, kPlain};
    paint.material = kStuffs[static_cast<int>(ground.stuff)];
    if (ground.stuff == GroundStuff::kChecker) {
        paint.base = {0.8f, 0.8f, 0.8f};
        paint.second = {0.03f, 0.03f, 0.04f};
    }
    if (ground.stuff == GroundStuff::kBeige)
        paint.base = linear(mix(Vec3{0.86f, 0.76f, 0.56f}, {0.74f, 0.63f, 0.45f}, paint.amount));
    world.paints.push_back(paint);
    world.primitives.push_back(p);
    if (ground.kind == GroundKind::kPlate && ground.rim) add_rim(world, ground, p);
}

}  // namespace

Footprint footprint(const ObjectSpec& spec) {
    static const std::vector<int> none;
    Builder builder(Rng(spec.seed).fork(11), none);
    shape_info(spec.shape).build(builder);
    const Builder::Result built = builder.finish();
    const Mat3 r = object_rotation(spec);
    const Vec3 h = built.half;
    const Vec3 middle{0, 0, h.z};
    return {absolute(r.a) * h.x + absolute(r.b) * h.y + absolute(r.c) * h.z, r * (built.anchor - middle) + middle,
            built.anchor_width};
}

World build_world(const SceneSpec& spec) {
    World world;
    world.primitives.reserve(160);
    for (const ObjectSpec& object : spec.objects) add_object(world, object);
    world.low = {1e9f, 1e9f, 1e9f};
    world.high = {-1e9f, -1e9f, -1e9f};
    for (const Primitive& p : world.primitives) {
        if (world.objects[static_cast<size_t>(p.object)].role == Role::kClutter || p.layer == Layer::kFlame) continue;
        const Vec3 bound = world_bound(p);
        world.low = minimum(world.low, p.centre - bound);
        world.high = maximum(world.high, p.centre + bound);
    }
    add_ground(world, spec.ground);
    return world;
}

namespace {

// A key light roughly from behind the camera, a weak fill light, and an ambient term that makes up for a weak key.
void draw_lights(View& v, float azimuth, Rng& rng) {
    const float key_azimuth = azimuth + 1.25f * rng.bell(), key_height = rng.uniform(0.45f, 1.4f);
    v.key_direction = {cosine(key_height) * cosine(key_azimuth), cosine(key_height) * sine(key_azimuth),
                       sine(key_height)};
    const float warm = 0.08f * rng.bell(), strength = rng.uniform(0.35f, 0.85f);
    v.key = Vec3{1 + warm, 1, 1 - warm} * strength;
    const float fill_azimuth = rng.uniform(0, 2 * kPi);
    v.fill_direction = normalized({cosine(fill_azimuth), sine(fill_azimuth), 0.4f});
    v.fill = Vec3{1, 1, 1} * rng.uniform(0.05f, 0.3f);
    v.ambient = Vec3{1 - warm * 0.5f, 1, 1 + warm * 0.5f} * (rng.uniform(0.85f, 1.02f) - strength * 0.75f);
    const float sky = rng.uniform(0.45f, 1.0f);
    v.sky = {sky * rng.uniform(0.85f, 1.0f), sky * rng.uniform(0.92f, 1.0f), sky};
    v.horizon = Vec3{1, 1, 1} * rng.uniform(0.02f, 0.14f);
}

}  // namespace

View make_view(uint64_t seed, const Settings& s, Vec3 low, Vec3 high) {
    View v;
    Rng rng = Rng(seed).fork(31);
    const Vec3 centre = (low + high) * 0.5f;
    const float radius = 0.5f * length(high - low) * 0.82f;
    const float azimuth = rng.uniform(0, 2 * kPi);
    const float u = rng.uniform();  // low and middle heights are more frequent
    const float elevation = (kPi / 180.0f) * mix(s.elevation_min, s.elevation_max, u * (0.6f + 0.4f * u));
    const Vec3 back{cosine(elevation) * cosine(azimuth), cosine(elevation) * sine(azimuth), sine(elevation)};
    const float half_fov = (kPi / 360.0f) * rng.uniform(s.fov_min, s.fov_max);
    v.tangent = sine(half_fov) / cosine(half_fov);
    const bool close = rng.chance(s.cropped);
    const float fill = close ? rng.uniform(1.0f, 1.7f) : rng.uniform(s.frame_min, s.frame_max);
    const float distance = std::max(radius / (sine(half_fov) * fill), radius * 1.15f);
    v.eye = centre + back * distance;
    v.axes.c = -back;
    v.axes.a = normalized(cross(v.axes.c, {0, 0, 1}));
    v.axes.b = cross(v.axes.a, v.axes.c);
    const float roll = 0.06f * rng.bell();
    const Vec3 right = v.axes.a * cosine(roll) + v.axes.b * sine(roll);
    v.axes.b = v.axes.b * cosine(roll) - v.axes.a * sine(roll);
    v.axes.a = right;
    const float room = close ? 0.45f : std::max(0.0f, 0.95f - 0.85f * fill);
    v.shift_x = room * rng.uniform(-1, 1);
    v.shift_y = room * rng.uniform(-1, 1);

    draw_lights(v, azimuth, rng);
    v.shadows = rng.chance(s.shadows);
    v.exposure = rng.uniform(0.82f, 1.06f);
    v.blur = rng.chance(s.blurred) ? rng.uniform(0.3f, 1.0f) : 0.0f;
    v.grain = rng.chance(s.grainy) ? rng.uniform(0.004f, 0.035f) : 0.0f;
    v.grain_seed = rng.next();
    return v;
}

}  // namespace fieldgraft::generator
