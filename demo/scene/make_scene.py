"""Models the demo's still life and renders its dataset with the add-on's camera code; our own work, as is its output.

    blender -b --factory-startup --python demo/scene/make_scene.py -- [--out DIR] [--samples N] [--preview]

A wooden table top with a yellow monkey (Blender's Suzanne) on a grey stand, a red ball, a blue cube, a green cone, a
purple mug and a golden ring: one plain colour each, well apart, so that "red ball" means one thing. Units: the scene is
within ±1.4 of the origin (the box of NeRF-synthetic scenes is ±1.5), the cameras 4.2 away. Light is a white sky and one
large lamp; there is nothing a camera could see behind the objects, so the pictures are RGBA.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

import bpy

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT))
from blender_addon import cameras, dataset  # noqa: E402

SPLITS = {"train": 60, "val": 8, "test": 8}
SIZE, ANGLE_X, RADIUS, CENTRE = 224, math.radians(40.0), 4.2, (0.0, 0.0, -0.25)
TABLE = -0.5  # height of the table top


def set_input(node: bpy.types.Node, names: tuple[str, ...], value: object) -> None:
    """Sets the first input that this Blender version knows under one of the names."""
    for name in names:
        if name in node.inputs:
            node.inputs[name].default_value = value
            return


def material(
    name: str, color: tuple[float, float, float], roughness: float, metallic: float = 0.0
) -> bpy.types.Material:
    result = bpy.data.materials.new(name)
    result.use_nodes = True
    node = result.node_tree.nodes["Principled BSDF"]
    node.inputs["Base Color"].default_value = (*color, 1.0)
    node.inputs["Roughness"].default_value = roughness
    node.inputs["Metallic"].default_value = metallic
    set_input(node, ("Specular", "Specular IOR Level"), 0.3)
    return result


def wood() -> bpy.types.Material:
    """Brown with long, stretched grain."""
    result = material("wood", (0.3, 0.15, 0.06), 0.6)
    tree = result.node_tree
    place = tree.nodes.new("ShaderNodeTexCoord")
    stretch = tree.nodes.new("ShaderNodeMapping")
    stretch.inputs["Scale"].default_value = (1.2, 9.0, 9.0)
    noise = tree.nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 1.6
    noise.inputs["Detail"].default_value = 3.0
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.elements[0].color = (0.2, 0.085, 0.03, 1.0)
    ramp.color_ramp.elements[1].color = (0.5, 0.26, 0.11, 1.0)
    ramp.color_ramp.elements[0].position, ramp.color_ramp.elements[1].position = 0.3, 0.7
    tree.links.new(place.outputs["Object"], stretch.inputs["Vector"])
    tree.links.new(stretch.outputs["Vector"], noise.inputs["Vector"])
    tree.links.new(noise.outputs["Fac"], ramp.inputs["Fac"])
    tree.links.new(ramp.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    return result


def finish(name: str, paint: bpy.types.Material, bevel: float = 0.0, subdivide: int = 0) -> bpy.types.Object:
    """Names, paints and smooths the object that was just added."""
    made = bpy.context.object
    made.name = name
    made.data.materials.append(paint)
    for polygon in made.data.polygons:
        polygon.use_smooth = subdivide > 0 or bevel == 0.0
    if bevel > 0.0:
        modifier = made.modifiers.new("bevel", "BEVEL")
        modifier.width, modifier.segments = bevel, 4
    if subdivide > 0:
        modifier = made.modifiers.new("smooth", "SUBSURF")
        modifier.levels = modifier.render_levels = subdivide
    return made


def rest_on(thing: bpy.types.Object, height: float) -> None:
    """Lowers the object until the lowest point of its finished surface is at `height`."""
    bpy.context.view_layer.update()
    finished = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    lowest = min((finished.matrix_world @ vertex.co).z for vertex in finished.data.vertices)
    thing.location.z += height - lowest - 0.003  # a hair sunk in, so that no light shows under it


def model_objects() -> None:
    add = bpy.ops.mesh
    add.primitive_cylinder_add(vertices=96, radius=1.25, depth=0.14, location=(0, 0, TABLE - 0.07))
    finish("table", wood(), bevel=0.03)
    add.primitive_cylinder_add(vertices=64, radius=0.36, depth=0.22, location=(0, 0, TABLE + 0.11))
    finish("stand", material("grey", (0.16, 0.16, 0.17), 0.5), bevel=0.02)
    add.primitive_monkey_add(size=0.9, location=(0, 0.08, 0), rotation=(math.radians(-35.8), 0, 0))
    rest_on(finish("monkey", material("yellow", (0.9, 0.58, 0.02), 0.45), subdivide=2), TABLE + 0.22)
    add.primitive_uv_sphere_add(segments=64, ring_count=32, radius=0.26, location=(-0.62, -0.62, TABLE + 0.26))
    finish("ball", material("red", (0.75, 0.02, 0.02), 0.35))
    add.primitive_cube_add(size=0.42, location=(0.66, -0.58, TABLE + 0.21), rotation=(0, 0, math.radians(28)))
    finish("cube", material("blue", (0.02, 0.1, 0.7), 0.5), bevel=0.02)
    add.primitive_cone_add(vertices=96, radius1=0.27, depth=0.62, location=(0.68, 0.62, TABLE + 0.31))
    finish("cone", material("green", (0.03, 0.4, 0.06), 0.5), bevel=0.01)
    add.primitive_torus_add(major_radius=0.22, minor_radius=0.075, location=(0.0, -0.93, TABLE + 0.075))
    finish("ring", material("gold", (0.9, 0.55, 0.12), 0.35, metallic=1.0))
    model_mug((-0.66, 0.6), material("purple", (0.25, 0.04, 0.5), 0.4))


def model_mug(place: tuple[float, float], paint: bpy.types.Material) -> None:
    """A wall of revolution, open above, and half a ring for the handle."""
    outer, inner, height, floor = 0.21, 0.185, 0.42, 0.03
    outline = [(0.0, 0.0), (outer, 0.0), (outer, height), (inner, height), (inner, floor), (0.0, floor)]
    steps = 64
    points = [
        (r * math.cos(2 * math.pi * i / steps), r * math.sin(2 * math.pi * i / steps), z)
        for i in range(steps)
        for r, z in outline
    ]
    n = len(outline)
    faces = [
        (i * n + k, (i + 1) % steps * n + k, (i + 1) % steps * n + k + 1, i * n + k + 1)
        for i in range(steps)
        for k in range(n - 1)
    ]
    mesh = bpy.data.meshes.new("mug")
    mesh.from_pydata(points, [], faces)
    mesh.materials.append(paint)
    mug = bpy.data.objects.new("mug", mesh)
    mug.location = (*place, TABLE)
    bpy.context.scene.collection.objects.link(mug)
    modifier = mug.modifiers.new("rim", "BEVEL")
    modifier.width, modifier.segments, modifier.limit_method = 0.008, 3, "ANGLE"
    away = math.atan2(place[1], place[0])
    centre = (place[0] + 0.2 * math.cos(away), place[1] + 0.2 * math.sin(away), TABLE + 0.21)
    rotation = (math.radians(90), 0, away)
    bpy.ops.mesh.primitive_torus_add(major_radius=0.12, minor_radius=0.03, location=centre, rotation=rotation)
    finish("handle", paint)


def light() -> None:
    """A white sky all around and one large soft lamp above the front left: shadows are there, never black."""
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("sky")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.75
    lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "AREA"))
    lamp.data.energy, lamp.data.shape, lamp.data.size = 160.0, "DISK", 3.0
    lamp.matrix_world = [list(column) for column in zip(*cameras.look_at((-2.2, -2.4, 3.6), CENTRE), strict=True)]
    scene.collection.objects.link(lamp)


def use_cycles(samples: int, threads: int) -> None:
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.seed = "CPU", samples, 1
    cycles.use_denoising, cycles.use_adaptive_sampling = False, False
    cycles.max_bounces, cycles.diffuse_bounces, cycles.glossy_bounces = 4, 3, 3
    cycles.caustics_reflective = cycles.caustics_refractive = False
    cycles.sample_clamp_indirect, cycles.blur_glossy = 2.0, 1.0
    scene.view_settings.view_transform = "Standard"
    if threads > 0:
        scene.render.threads_mode, scene.render.threads = "FIXED", threads


def main() -> None:
    parser = argparse.ArgumentParser(prog="make_scene.py")
    parser.add_argument("--out", type=Path, default=Path(__file__).resolve().parent)
    parser.add_argument("--samples", type=int, default=192)
    parser.add_argument("--size", type=int, default=SIZE)
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--preview", action="store_true", help="two views a split only")
    parser.add_argument("--resume", action="store_true", help="keep pictures that are there already")
    parser.add_argument("--blend", type=Path, help="also save the scene as this .blend")
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:])

    bpy.ops.wm.read_factory_settings(use_empty=True)
    model_objects()
    light()
    use_cycles(options.samples, options.threads)
    if options.blend:
        bpy.ops.wm.save_as_mainfile(filepath=str(options.blend.resolve()), copy=True)
    intrinsics = cameras.Intrinsics.from_angle_x(options.size, options.size, ANGLE_X)
    elevation = (math.radians(4.0), math.radians(80.0))
    splits = cameras.hemisphere_views(SPLITS, intrinsics, RADIUS, CENTRE, elevation)
    if options.preview:
        splits = {split: views[:: max(1, len(views) // 2)][:2] for split, views in splits.items()}
    for done, total in dataset.render_steps(bpy.context.scene, options.out, splits, options.resume):
        print(f"{done} of {total} pictures", flush=True)


if __name__ == "__main__":
    main()
