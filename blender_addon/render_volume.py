"""Renders a baked .vdb in Cycles from given cameras, as the field's own renderer shows it.

    blender -b --factory-startup --python blender_addon/render_volume.py -- --vdb X.vdb --cameras CAMERAS.json --out DIR

Also runs as `python render_volume.py …` where `bpy` is a Python module. For each camera NAME.exr (32-bit, the values
that were integrated) and NAME.png (the same values, 8 bit, no view transform). Exit code 2: bad usage or bad input.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
from blender_addon import cameras, materials  # noqa: E402


def parse(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="render_volume.py", description="Render a baked .vdb in Cycles.")
    parser.add_argument("--vdb", required=True, help="the baked volume")
    parser.add_argument("--cameras", required=True, help="transforms*.json or a nerfstudio camera path")
    parser.add_argument("--out", required=True, type=Path, help="folder for NAME.exr and NAME.png")
    parser.add_argument("--resolution", type=int, nargs=2, metavar=("W", "H"), help="picture size in pixels")
    parser.add_argument("--source-resolution", type=int, nargs=2, metavar=("W", "H"), help="the dataset's picture size")
    parser.add_argument("--views", help="comma-separated numbers or names of cameras (default: all)")
    parser.add_argument("--step-rate", type=float, default=0.1, help="march step as a share of a voxel")
    parser.add_argument("--samples", type=int, default=1, help="samples a pixel")
    parser.add_argument("--background", choices=["white", "black", "transparent"], default="white")
    parser.add_argument("--threads", type=int, default=0, help="0: all cores")
    parser.add_argument("--blend", type=Path, help="also save the scene as this .blend")
    parser.add_argument("--no-render", action="store_true", help="only set the scene up (with --blend)")
    return parser.parse_args(arguments)


def chosen_views(options: argparse.Namespace) -> list[cameras.View]:
    source, wanted = (tuple(size) if size else None for size in (options.source_resolution, options.resolution))
    views = cameras.read_views(options.cameras, source, fallback=wanted)
    if options.views:
        names = options.views.split(",")
        chosen = [v for i, v in enumerate(views) if str(i) in names or v.name in names]
        missing = [n for n in names if n not in {v.name for v in chosen} | {str(i) for i in range(len(views))}]
        if missing:
            raise ValueError(f"{options.cameras}: no camera {', '.join(missing)}; there are {len(views)}, from 0")
        views = chosen
    if wanted:
        views = [cameras.View(v.name, v.matrix, v.intrinsics.scaled_to(*wanted)) for v in views]
    return views


def empty_scene() -> bpy.types.Scene:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return bpy.context.scene


def save_render(scene: bpy.types.Scene, folder: Path, name: str, alpha: bool) -> None:
    """The last render as NAME.exr and NAME.png, each renamed into place."""
    settings, result = scene.render.image_settings, bpy.data.images["Render Result"]
    for suffix, file_format, depth in ((".exr", "OPEN_EXR", "32"), (".png", "PNG", "8")):
        settings.file_format, settings.color_depth = file_format, depth
        settings.color_mode = "RGBA" if alpha else "RGB"
        temporary = folder / f"{name}.part{suffix}"
        result.save_render(str(temporary), scene=scene)
        os.replace(temporary, folder / f"{name}{suffix}")


def run(options: argparse.Namespace) -> None:
    views = chosen_views(options)
    scene = empty_scene()
    materials.import_volume(scene, options.vdb)
    materials.use_exact_cycles(scene, options.step_rate, options.samples)
    materials.use_background(scene, options.background)
    if options.threads > 0:
        scene.render.threads_mode, scene.render.threads = "FIXED", options.threads
    scene.camera = cameras.new_camera(scene)
    cameras.apply_view(scene, scene.camera, views[0])
    options.out.mkdir(parents=True, exist_ok=True)
    if options.blend:
        temporary = options.blend.resolve().with_suffix(".part.blend")
        temporary.parent.mkdir(parents=True, exist_ok=True)
        bpy.ops.wm.save_as_mainfile(filepath=str(temporary), copy=True, relative_remap=False)
        os.replace(temporary, options.blend)
    started = time.monotonic()
    for done, view in enumerate([] if options.no_render else views, start=1):
        cameras.apply_view(scene, scene.camera, view)
        bpy.ops.render.render(scene=scene.name)
        save_render(scene, options.out, view.name, options.background == "transparent")
        elapsed = time.monotonic() - started
        event = {"event": "progress", "iteration": done, "total": len(views)}
        print(json.dumps({**event, "eta_s": round(elapsed / done * (len(views) - done), 1)}), flush=True)
    print(
        json.dumps({"event": "done", "views": len(views), "seconds": round(time.monotonic() - started, 3)}), flush=True
    )


def main() -> int:
    # Inside Blender our arguments follow "--"; as a script they are all ours.
    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    try:
        run(parse(arguments))
    except ValueError as error:
        print(f"render_volume.py: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.stdout.flush()
    sys.exit(main())
