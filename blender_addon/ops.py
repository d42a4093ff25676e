"""Operators. Bad input is reported as one line of ERROR and cancels; nothing half-done is reported as finished."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import bpy

from . import cameras, dataset, materials


def planned_views(scene: bpy.types.Scene) -> dict[str, list[cameras.View]]:
    """The dataset's views by split, out of the scene's settings; raises ValueError with one line."""
    settings = scene.fieldgraft.dataset
    if settings.source == "SCENE":
        views = cameras.scene_views(scene)
        if not views:
            raise ValueError("this scene has no cameras: add some, or choose Hemisphere")
        return cameras.split_views(views)
    if settings.source == "ANIMATION":
        frames = range(scene.frame_start, scene.frame_end + 1, scene.frame_step)
        return cameras.split_views(cameras.scene_views(scene, frames))
    if settings.highest < settings.lowest:
        raise ValueError("the highest elevation is below the lowest")
    return cameras.hemisphere_views(
        {"train": settings.train, "val": settings.val, "test": settings.test},
        cameras.Intrinsics.from_angle_x(settings.width, settings.height, settings.angle_x),
        settings.radius,
        tuple(settings.centre),
        (settings.lowest, settings.highest),
    )


def dataset_folder(scene: bpy.types.Scene) -> Path:
    name = scene.fieldgraft.dataset.folder
    if not name:
        raise ValueError("no folder is set for the dataset")
    if name.startswith("//") and not bpy.data.filepath:
        raise ValueError(f"the folder {name} is relative to the .blend file: save the file first, or name a full path")
    return Path(bpy.path.abspath(name))


class FIELDGRAFT_OT_render_dataset(bpy.types.Operator):
    bl_idname = "fieldgraft.render_dataset"
    bl_label = "Render dataset"
    bl_description = "Render this scene from many cameras to RGBA pictures and transforms files, ready for training"

    _steps: Iterator[tuple[int, int]] | None = None
    _timer = None

    def _plan(self, context: bpy.types.Context) -> bool:
        try:
            folder, views = dataset_folder(context.scene), planned_views(context.scene)
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return False
        self._steps = dataset.render_steps(context.scene, folder, views)
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        """All in one go: scripts and headless Blender."""
        if not self._plan(context):
            return {"CANCELLED"}
        try:
            for _ in self._steps:
                pass
        except (RuntimeError, OSError) as error:
            self.report({"ERROR"}, f"dataset not finished: {str(error).strip()}")
            return {"CANCELLED"}
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """In the interface: one picture a timer tick, Esc stops."""
        if not self._plan(context):
            return {"CANCELLED"}
        context.window_manager.progress_begin(0, 1)
        self._timer = context.window_manager.event_timer_add(0.05, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC":
            self._steps.close()
            return self._finish(context, "WARNING", "dataset stopped: the pictures so far are kept", "CANCELLED")
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            done, total = next(self._steps)
        except StopIteration:
            return self._finish(context, "INFO", "dataset rendered", "FINISHED")
        except (RuntimeError, OSError) as error:
            return self._finish(context, "ERROR", f"dataset not finished: {str(error).strip()}", "CANCELLED")
        context.window_manager.progress_update(done / total)
        context.workspace.status_text_set(f"Fieldgraft: {done} of {total} pictures (Esc stops)")
        return {"RUNNING_MODAL"}

    def _finish(self, context: bpy.types.Context, level: str, message: str, result: str) -> set[str]:
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
        self.report({level}, message)
        return {result}


class FIELDGRAFT_OT_import_volume(bpy.types.Operator):
    bl_idname = "fieldgraft.import_volume"
    bl_label = "Import baked volume"
    bl_description = "Load a .vdb that Fieldgraft baked, with the material that renders it as the field looks"
    bl_options = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH")
    filter_glob: bpy.props.StringProperty(default="*.vdb", options={"HIDDEN"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            materials.import_volume(context.scene, self.filepath)
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


CLASSES = (FIELDGRAFT_OT_render_dataset, FIELDGRAFT_OT_import_volume)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
