"""Rendering a dataset: pictures of given views as straight-alpha RGBA PNG, and the transforms files beside them.

`render_steps` is a generator: it renders one picture a step and yields (done, total), so that a script runs it in one
go and the interface one step a timer tick, with progress and Cancel. The scene's render settings are put back at the
end, however it ends. Pictures are rendered under a temporary name and renamed; the transforms files come last, so a
folder that has them is whole.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from . import cameras

# What rendering a dataset changes, as (owner, attribute); owners are looked up on the scene.
_CHANGED = {
    "render": (
        *("resolution_x", "resolution_y", "resolution_percentage", "pixel_aspect_x", "pixel_aspect_y", "filepath"),
        *("film_transparent", "use_file_extension", "use_border", "use_overwrite"),
        "dither_intensity",
    ),
    "render.image_settings": ("file_format", "color_mode", "color_depth", "compression"),
    "cycles": ("use_denoising",),
    "": ("camera",),
}


def _owner(scene: Any, path: str) -> Any:
    """None where this Blender has no such thing (Cycles can be left out of a build)."""
    for name in filter(None, path.split(".")):
        scene = getattr(scene, name, None)
    return scene


@contextmanager
def kept_settings(scene: Any) -> Iterator[None]:
    """Puts the render settings and the active camera back on leaving."""
    before = [
        (path, name, getattr(_owner(scene, path), name))
        for path, names in _CHANGED.items()
        for name in names
        if hasattr(_owner(scene, path), name)
    ]
    try:
        yield
    finally:
        for path, name, value in before:
            setattr(_owner(scene, path), name, value)


def use_rgba_png(scene: Any) -> None:
    render = scene.render
    render.film_transparent, render.use_border, render.use_overwrite = True, False, True
    render.use_file_extension, render.dither_intensity = False, 0.0
    if hasattr(render.image_settings, "media_type"):  # Blender 5: the format list depends on the kind of medium
        render.image_settings.media_type = "IMAGE"
    render.image_settings.file_format, render.image_settings.color_mode = "PNG", "RGBA"
    render.image_settings.color_depth, render.image_settings.compression = "8", 100


def without_missing_denoiser(scene: Any) -> None:
    """Denoising is on by default, and rendering fails in builds that lack the denoiser (Debian's): then without."""
    if scene.render.engine != "CYCLES" or scene.cycles.device == "GPU":
        return
    import _cycles

    if not getattr(_cycles, "with_openimagedenoise", True):
        scene.cycles.use_denoising = False


def render_picture(scene: Any, path: Path) -> None:
    """Renders the scene's active camera to `path`, atomically."""
    import bpy

    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f"{path.stem}.part{path.suffix}")
    scene.render.filepath = str(temporary)
    bpy.ops.render.render(write_still=True, scene=scene.name)
    if not temporary.exists():
        raise RuntimeError(f"Blender wrote no picture for {path.name}: was the rendering cancelled?")
    os.replace(temporary, path)


def render_steps(
    scene: Any, folder: Path, splits: dict[str, list[cameras.View]], keep_existing: bool = False
) -> Iterator[tuple[int, int]]:
    """Renders all views of all splits into folder/split/name.png, then writes the transforms files.

    With `keep_existing` a picture that is there already stays: an interrupted run goes on where it stopped.
    """
    import bpy

    total = sum(len(views) for views in splits.values())
    camera = cameras.new_camera(scene, "Fieldgraft dataset camera")
    try:
        with kept_settings(scene):
            use_rgba_png(scene)
            without_missing_denoiser(scene)
            scene.camera = camera
            done = 0
            for split, views in splits.items():
                for view in views:
                    path = folder / split / f"{view.name}.png"
                    if not (keep_existing and path.exists()):
                        cameras.apply_view(scene, camera, view)
                        render_picture(scene, path)
                    done += 1
                    yield done, total
    finally:
        data = camera.data
        bpy.data.objects.remove(camera)
        bpy.data.cameras.remove(data)
    cameras.write_dataset_files(folder, splits)
