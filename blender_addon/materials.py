"""Baked volumes in Blender: import of a .vdb, its material, and what each Blender version needs to show it right.

A baked field is an emission–absorption medium: `density` σ per unit of length, `color` c as the pictures hold it
(sRGB-encoded). The material is Volume Absorption (black, density σ) + Emission (colour c, strength σ), so Cycles sums
C = Σ T (1 − exp(−σδ)) c: the field's own integral with conserving compositing. With the "Raw" view transform pictures
come out as the field's renderer makes them.

Corrections (measured against an independent march of the same grids):
* Blender < 5.0 shows voxel i's value at its corner's far side, T(i + ½): the object is shifted by −½ voxel.
* Blender ≥ 5.0: `cycles.volume_biased`, and a MAXIMUM-with-0 node after each Attribute node; without a non-linear node
  there attributes are interpolated stochastically (noise).
* The step is a share of a voxel (`volume_step_rate`); one sample a pixel through its centre (`filter_width` 0.01).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from mathutils import Matrix, Vector

MATERIAL_NAME = "Fieldgraft volume"


def _attribute(tree: Any, name: str, output: str, y: float) -> Any:
    """The socket that holds the grid's values, never below 0."""
    node = tree.nodes.new("ShaderNodeAttribute")
    node.attribute_name, node.location = name, (-600, y)
    if bpy.app.version < (5, 0, 0):
        return node.outputs[output]
    vector = output != "Fac"
    clamp = tree.nodes.new("ShaderNodeVectorMath" if vector else "ShaderNodeMath")
    clamp.operation, clamp.location = "MAXIMUM", (-400, y)
    clamp.inputs[1].default_value = (0.0, 0.0, 0.0) if vector else 0.0
    tree.links.new(node.outputs[output], clamp.inputs[0])
    return clamp.outputs[0]


def volume_material(name: str = MATERIAL_NAME, density_scale: float = 1.0) -> bpy.types.Material:
    """A new emission–absorption material; `density_scale` multiplies σ (1 over the scale of a scaled object)."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    density = _attribute(tree, "density", "Fac", 200)
    color = _attribute(tree, "color", "Color" if bpy.app.version < (5, 0, 0) else "Vector", -100)
    scale = tree.nodes.new("ShaderNodeMath")
    scale.name = scale.label = "Density scale"
    scale.operation, scale.location = "MULTIPLY", (-200, 200)
    scale.inputs[1].default_value = density_scale
    tree.links.new(density, scale.inputs[0])

    absorption = tree.nodes.new("ShaderNodeVolumeAbsorption")
    absorption.inputs["Color"].default_value, absorption.location = (0.0, 0.0, 0.0, 1.0), (0, 200)
    emission = tree.nodes.new("ShaderNodeEmission")
    emission.location = (0, 0)
    tree.links.new(scale.outputs[0], absorption.inputs["Density"])
    tree.links.new(scale.outputs[0], emission.inputs["Strength"])
    tree.links.new(color, emission.inputs["Color"])

    both = tree.nodes.new("ShaderNodeAddShader")
    both.location = (200, 100)
    tree.links.new(absorption.outputs[0], both.inputs[0])
    tree.links.new(emission.outputs[0], both.inputs[1])
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    output.location = (400, 100)
    tree.links.new(both.outputs[0], output.inputs["Volume"])
    return material


def _loaded_grids(volume: bpy.types.Volume, path: Path) -> dict[str, Any]:
    # The return value counts: `is_loaded` stays False in some versions.
    if not volume.grids.load():
        raise ValueError(f"{path}: not a readable .vdb ({volume.grids.error_message or 'unknown error'})")
    grids = {grid.name: grid for grid in volume.grids}
    for name in ("density", "color"):
        if name not in grids:
            raise ValueError(f'{path}: no grid named "{name}" (found: {", ".join(grids) or "none"})')
    return grids


def import_volume(scene: bpy.types.Scene, filepath: str, name: str | None = None) -> bpy.types.Object:
    """Loads a baked .vdb under an empty that stands for it (move, turn, animate the empty); returns the volume object.

    The volume's own location carries the version's half-voxel correction. Raises ValueError with one line.
    """
    path = Path(bpy.path.abspath(filepath)).resolve()
    if not path.is_file():
        raise ValueError(f"{path}: no such file")
    name = name or path.stem
    data = bpy.data.volumes.new(name)
    data.filepath = str(path)
    try:
        grids = _loaded_grids(data, path)
    except ValueError:
        bpy.data.volumes.remove(data)
        raise
    render = data.render
    render.space, render.precision, render.clipping, render.step_size = "OBJECT", "FULL", 0.0, 0.0
    data.materials.append(volume_material(f"{MATERIAL_NAME}: {name}"))

    volume = bpy.data.objects.new(name, data)
    proxy = bpy.data.objects.new(f"{name} frame", None)
    scene.collection.objects.link(proxy)
    scene.collection.objects.link(volume)
    volume.parent = proxy
    volume.location = half_voxel_shift(grids["density"].matrix_object)
    return volume


def half_voxel_shift(index_to_object: Matrix) -> Vector:
    """What to add to the object's location so that voxel i's value is shown at index_to_object · i."""
    if bpy.app.version >= (5, 0, 0):
        return Vector((0.0, 0.0, 0.0))
    return index_to_object.to_3x3() @ Vector((-0.5, -0.5, -0.5))


def use_exact_cycles(scene: bpy.types.Scene, step_rate: float = 0.1, samples: int = 1) -> None:
    """Cycles settings under which a baked volume's picture is the field's integral, in the field's own values."""
    if not step_rate > 0.0 or samples < 1:
        raise ValueError(f"step rate {step_rate} and samples {samples}: both must be positive")
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = samples, False, False
    cycles.filter_width, cycles.pixel_filter_type = 0.01, "BLACKMAN_HARRIS"
    cycles.volume_step_rate, cycles.volume_max_steps = step_rate, 65536
    if hasattr(cycles, "volume_biased"):
        cycles.volume_biased = True
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    scene.render.use_motion_blur, scene.render.dither_intensity = False, 0.0
    # Values as they are: no film curve, no second sRGB encoding.
    scene.view_settings.view_transform = "Raw"
    scene.view_settings.look = "None"
    scene.view_settings.exposure, scene.view_settings.gamma = 0.0, 1.0


def use_background(scene: bpy.types.Scene, kind: str) -> None:
    """ "white" (a world that emits 1) or "transparent" (alpha in the film)."""
    if kind not in ("white", "black", "transparent"):
        raise ValueError(f'background "{kind}": white, black or transparent')
    scene.render.film_transparent = kind == "transparent"
    value = 1.0 if kind == "white" else 0.0
    world = scene.world or bpy.data.worlds.new("World")
    scene.world = world
    world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    background, output = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeOutputWorld")
    background.inputs["Color"].default_value = (value, value, value, 1.0)
    tree.links.new(background.outputs[0], output.inputs["Surface"])
