"""Models more scenes of our own and renders their datasets, for measuring on things the defaults were not chosen by.

    blender -b --factory-startup --python bench/scenes/make_scenes.py -- NAME --out DIR [--size N] [--samples N]

chair: turned legs and a checked cushion on a rug. plant: a pot with thin, bent, overlapping leaves. house: bricks,
tiles, windows, a fence and trees. engine: a toy locomotive of shiny metal. Modelled by this script alone, within ±1.4
of the origin, lit and seen like the demo scene (RGBA, NeRF-synthetic form). room: the demo's table in a room with
cameras between it and the walls, as somebody would photograph it (opaque pictures, nerfstudio form). The pictures are
made where they are needed and not kept in the repository.
"""

from __future__ import annotations

import argparse
import math
import random
import sys
from collections.abc import Callable
from pathlib import Path

import bpy

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "demo" / "scene")]
import make_scene as demo  # noqa: E402

from blender_addon import cameras, dataset  # noqa: E402

Color = tuple[float, float, float]
add = bpy.ops.mesh


def patterned(name: str, node: str, colors: list[Color], scale: float, roughness: float = 0.6) -> bpy.types.Material:
    """A material of one of Blender's procedural patterns (ShaderNodeTexChecker, ShaderNodeTexBrick)."""
    result = demo.material(name, colors[0], roughness)
    tree = result.node_tree
    place = tree.nodes.new("ShaderNodeTexCoord")
    pattern = tree.nodes.new(node)
    pattern.inputs["Scale"].default_value = scale
    for socket, color in zip(("Color1", "Color2", "Mortar"), colors, strict=False):
        demo.set_input(pattern, (socket,), (*color, 1.0))
    tree.links.new(place.outputs["Object"], pattern.inputs["Vector"])
    tree.links.new(pattern.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    return result


def box(name: str, size: Color, place: Color, paint: bpy.types.Material, bevel: float = 0.015) -> bpy.types.Object:
    add.primitive_cube_add(size=1.0, location=place)
    bpy.context.object.scale = size
    bpy.ops.object.transform_apply(location=False, rotation=False, scale=True)
    return demo.finish(name, paint, bevel=bevel)


def rod(
    name: str, radius: float, start: Color, end: Color, paint: bpy.types.Material, top: float | None = None
) -> bpy.types.Object:
    """A cylinder (or, with another radius at its end, part of a cone) between two points."""
    along = [b - a for a, b in zip(start, end, strict=True)]
    length = math.sqrt(sum(c * c for c in along))
    middle = tuple((a + b) / 2 for a, b in zip(start, end, strict=True))
    turn = (0.0, math.acos(along[2] / length), math.atan2(along[1], along[0]))
    radii = {"radius1": radius, "radius2": radius if top is None else top}
    add.primitive_cone_add(vertices=48, depth=length, location=middle, rotation=turn, **radii)
    return demo.finish(name, paint, bevel=0.004)


def chair() -> None:
    wood = demo.wood()
    checked = patterned("checked", "ShaderNodeTexChecker", [(0.7, 0.05, 0.06), (0.8, 0.75, 0.6)], 9.0)
    rug = patterned("rug", "ShaderNodeTexChecker", [(0.06, 0.12, 0.3), (0.3, 0.33, 0.4)], 5.0, 0.9)
    add.primitive_cylinder_add(vertices=96, radius=1.2, depth=0.04, location=(0, 0, -0.98))
    demo.finish("rug", rug)
    for x in (-0.5, 0.5):
        for y in (-0.5, 0.5):
            rod("leg", 0.04, (1.1 * x, 1.1 * y, -0.96), (0.95 * x, 0.95 * y, -0.2), wood, 0.065)
        rod("post", 0.055, (0.95 * x, 0.475, -0.2), (0.95 * x, 0.62, 0.95), wood, 0.04)
        rod("rung", 0.03, (1.02 * x, -0.52, -0.6), (1.02 * x, 0.52, -0.6), wood)
    box("seat", (1.15, 1.15, 0.08), (0, 0, -0.18), wood)
    box("cushion", (1.0, 1.0, 0.14), (0, -0.02, -0.08), checked, 0.06)
    for i in range(7):
        x = (i - 3) * 0.13
        rod("spindle", 0.022, (x, 0.485, -0.15), (x, 0.6, 0.8), wood)
    box("rail", (1.08, 0.07, 0.2), (0, 0.61, 0.85), wood, 0.03)


def leaf(name: str, length: float, width: float, bend: float, paint: bpy.types.Material) -> bpy.types.Object:
    """A blade from the origin along x that rises and falls over."""
    steps = 10
    points, faces = [], []
    for i in range(steps + 1):
        t = i / steps
        half = width * math.sin(math.pi * min(1.0, 0.12 + 0.88 * t)) ** 0.8
        x, z = length * t, length * (0.9 * t - bend * t * t)
        points += [(x, -half, z + 0.2 * half), (x, 0.0, z), (x, half, z + 0.2 * half)]
    for i in range(steps):
        for k in range(2):
            a = 3 * i + k
            faces.append((a, a + 1, a + 4, a + 3))
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points, [], faces)
    mesh.materials.append(paint)
    for polygon in mesh.polygons:
        polygon.use_smooth = True
    made = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(made)
    return made


def plant() -> None:
    chance = random.Random(3)
    add.primitive_cylinder_add(vertices=96, radius=0.75, depth=0.06, location=(0, 0, -0.97))
    demo.finish("saucer", demo.material("white", (0.75, 0.75, 0.72), 0.3), bevel=0.02)
    rod("pot", 0.42, (0, 0, -0.94), (0, 0, -0.3), demo.material("clay", (0.5, 0.16, 0.07), 0.8), 0.6)
    rod("earth", 0.55, (0, 0, -0.33), (0, 0, -0.28), demo.material("earth", (0.05, 0.03, 0.02), 1.0), 0.55)
    greens = [demo.material(f"green {i}", (0.02 + 0.05 * i, 0.16 + 0.07 * i, 0.03), 0.45) for i in range(4)]
    for i in range(64):
        length, width, bend = chance.uniform(0.6, 1.15), chance.uniform(0.04, 0.09), chance.uniform(0.2, 1.1)
        made = leaf("leaf", length, width, bend, greens[i % 4])
        made.location = (0.1 * math.cos(i), 0.1 * math.sin(i), -0.3)
        made.rotation_euler = (0.0, -chance.uniform(0.0, 0.7), i * 2.39996)
    red = demo.material("blossom", (0.7, 0.04, 0.2), 0.5)
    for i in range(7):
        a, h = i * 0.9, chance.uniform(0.5, 0.95)
        tip = (0.5 * math.cos(a), 0.5 * math.sin(a), h)
        rod("stalk", 0.015, (0, 0, -0.3), tip, greens[0])
        add.primitive_uv_sphere_add(segments=32, ring_count=16, radius=0.08, location=tip)
        demo.finish("blossom", red)


def house() -> None:
    grass = demo.material("grass", (0.1, 0.22, 0.04), 1.0)
    bricks = patterned("bricks", "ShaderNodeTexBrick", [(0.35, 0.07, 0.04), (0.45, 0.12, 0.06), (0.6, 0.58, 0.5)], 4.0)
    tiles = patterned("tiles", "ShaderNodeTexBrick", [(0.05, 0.06, 0.1), (0.09, 0.1, 0.16), (0.01, 0.01, 0.02)], 6.0)
    white, glass = demo.material("white", (0.8, 0.8, 0.78), 0.5), demo.material("glass", (0.05, 0.12, 0.2), 0.08)
    add.primitive_cylinder_add(vertices=96, radius=1.35, depth=0.06, location=(0, 0, -0.83))
    demo.finish("grass", grass)
    box("walls", (1.3, 0.9, 0.8), (0, 0, -0.4), bricks, 0.0)
    for side in (-1, 1):
        roof = box("roof", (1.46, 0.7, 0.05), (0, 0.26 * side, 0.2), tiles, 0.0)
        roof.rotation_euler = (math.radians(-42 * side), 0, 0)
        for x in (-0.4, 0.4):
            box("frame", (0.27, 0.03, 0.32), (x, 0.455 * side, -0.3), white)
            box("pane", (0.22, 0.04, 0.27), (x, 0.457 * side, -0.3), glass)
            box("bar", (0.02, 0.05, 0.27), (x, 0.46 * side, -0.3), white, 0.0)
    box("gable", (1.28, 0.5, 0.38), (0, 0, 0.12), bricks, 0.0)
    box("door", (0.24, 0.04, 0.48), (0, -0.46, -0.56), demo.material("door", (0.05, 0.25, 0.3), 0.4))
    box("chimney", (0.16, 0.16, 0.5), (0.4, 0.12, 0.55), bricks, 0.0)
    for i in range(28):
        a = 2 * math.pi * i / 28
        if abs(a - 1.5 * math.pi) < 0.2:
            continue
        box("picket", (0.05, 0.05, 0.26), (1.22 * math.cos(a), 1.22 * math.sin(a), -0.68), white, 0.01)
    for i, (x, y) in enumerate([(-0.95, -0.45), (0.95, 0.4), (-0.85, 0.55)]):
        rod("trunk", 0.05, (x, y, -0.8), (x, y, -0.45), demo.wood())
        green = demo.material("tree", (0.02, 0.1 + 0.04 * i, 0.03), 1.0)
        for k in range(3):
            z = -0.55 + 0.22 * k
            rod("tree", 0.24 - 0.06 * k, (x, y, z), (x, y, z + 0.34), green, 0.01)


def engine() -> None:
    steel = demo.material("steel", (0.4, 0.42, 0.45), 0.25, 1.0)
    black = demo.material("black", (0.02, 0.02, 0.025), 0.3)
    red, brass = demo.material("red", (0.55, 0.02, 0.02), 0.25), demo.material("brass", (0.8, 0.5, 0.12), 0.2, 1.0)
    blue, wood = demo.material("blue", (0.02, 0.08, 0.4), 0.2), demo.wood()
    for i in range(11):
        box("sleeper", (0.12, 1.1, 0.06), (-1.2 + 0.24 * i, 0, -0.9), wood)
    for y in (-0.4, 0.4):
        box("rail", (2.5, 0.05, 0.07), (0, y, -0.84), steel, 0.005)
        for x, r in [(-0.75, 0.3), (-0.1, 0.3), (0.45, 0.2), (0.85, 0.2)]:
            rod("tyre", r, (x, y - 0.05, -0.8 + r), (x, y + 0.05, -0.8 + r), red)
            rod("hub", 0.3 * r, (x, y - 0.08, -0.8 + r), (x, y + 0.08, -0.8 + r), brass)
        side = 1.15 * y
        rod("coupling rod", 0.03, (-0.75, side, -0.6), (-0.1, side, -0.6), steel)
    box("frame", (2.1, 0.62, 0.12), (0, 0, -0.36), black)
    rod("boiler", 0.33, (-0.35, 0, 0.02), (0.95, 0, 0.02), blue)
    for x in (-0.1, 0.3, 0.7):
        rod("band", 0.34, (x - 0.02, 0, 0.02), (x + 0.02, 0, 0.02), brass)
    rod("smokebox", 0.35, (0.95, 0, 0.02), (1.15, 0, 0.02), black)
    rod("chimney", 0.09, (0.85, 0, 0.3), (0.85, 0, 0.75), black, 0.14)
    add.primitive_uv_sphere_add(segments=48, ring_count=24, radius=0.16, location=(0.3, 0, 0.36))
    demo.finish("dome", brass)
    box("cab", (0.62, 0.8, 0.75), (-0.7, 0, 0.08), red, 0.02)
    for y in (-0.41, 0.41):
        box("window", (0.34, 0.02, 0.26), (-0.7, y, 0.22), black)
    box("roof", (0.8, 0.95, 0.06), (-0.7, 0, 0.5), black, 0.02)
    box("buffer beam", (0.08, 0.9, 0.2), (1.1, 0, -0.38), red)


def room() -> None:
    demo.model_objects()
    floor = patterned("floor", "ShaderNodeTexChecker", [(0.35, 0.2, 0.1), (0.5, 0.42, 0.3)], 1.5)
    wall = patterned("wall", "ShaderNodeTexBrick", [(0.5, 0.45, 0.35), (0.42, 0.4, 0.33), (0.25, 0.22, 0.2)], 1.2)
    wood, chance = demo.wood(), random.Random(5)
    rod("leg", 0.12, (0, 0, -1.6), (0, 0, -0.62), wood, 0.2)
    box("floor", (9.0, 9.0, 0.1), (0, 0, -1.65), floor, 0.0)
    box("ceiling", (9.0, 9.0, 0.1), (0, 0, 3.6), demo.material("white", (0.7, 0.7, 0.7), 1.0), 0.0)
    for i, (x, y) in enumerate([(4.4, 0), (0, 4.4), (-4.4, 0), (0, -4.4)]):
        size = (0.1, 9.0, 5.3) if i % 2 == 0 else (9.0, 0.1, 5.3)
        box("wall", size, (x, y, 1.0), wall, 0.0)
        for k in range(2):  # pictures on it
            along, paint = 1.6 * (2 * k - 1), demo.material("paint", tuple(chance.random() for _ in range(3)), 0.6)
            place = (0.97 * x, along, 0.9) if i % 2 == 0 else (along, 0.97 * y, 0.9)
            box("picture", (0.06, 1.2, 0.9) if i % 2 == 0 else (1.2, 0.06, 0.9), place, paint)
    box("cupboard", (1.0, 2.0, 1.8), (3.8, 2.4, -0.7), wood)
    box("bench", (2.2, 0.7, 0.7), (-1.5, 3.9, -1.25), demo.material("red", (0.5, 0.06, 0.05), 0.7))


SCENES: dict[str, Callable[[], None]] = {f.__name__: f for f in (chair, plant, house, engine, room)}


def main() -> None:
    parser = argparse.ArgumentParser(prog="make_scenes.py")
    parser.add_argument("name", choices=SCENES)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--size", type=int, default=400)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--views", type=int, default=100, help="to train with; a tenth of it to validate and to test")
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--preview", action="store_true", help="two views a split only")
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :])

    bpy.ops.wm.read_factory_settings(use_empty=True)
    SCENES[options.name]()
    demo.light()
    if options.name == "room":  # the sky is shut out: a wide lamp under the ceiling
        lamp = bpy.data.objects["lamp"]
        lamp.data.energy, lamp.data.size = 900.0, 6.0
        lamp.matrix_world = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 3.4, 1]]
    demo.use_cycles(options.samples, options.threads)
    intrinsics = cameras.Intrinsics.from_angle_x(options.size, options.size, demo.ANGLE_X)
    counts = {"train": options.views, "val": options.views // 10, "test": options.views // 10}
    elevation = (math.radians(4.0), math.radians(80.0))
    radius = demo.RADIUS
    if options.name == "room":
        intrinsics = cameras.Intrinsics.from_angle_x(options.size, options.size, math.radians(60.0))
        counts, elevation, radius = counts | {"val": 0}, (math.radians(8.0), math.radians(50.0)), 2.6
    splits = cameras.hemisphere_views(counts, intrinsics, radius, (0.0, 0.0, -0.05), elevation)
    if options.preview:
        splits = {split: views[:: max(1, len(views) // 2)][:2] for split, views in splits.items()}
    for done, total in dataset.render_steps(bpy.context.scene, options.out, splits, keep_existing=True):
        print(f"{done} of {total} pictures", flush=True)
    if options.name == "room":
        cameras.write_json(options.out / "transforms.json", cameras.nerfstudio_transforms(splits))
        for split in splits:
            (options.out / f"transforms_{split}.json").unlink()


if __name__ == "__main__":
    main()
