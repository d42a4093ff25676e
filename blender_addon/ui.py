"""The "Fieldgraft" tab of the 3D view's side panel."""

from __future__ import annotations

import bpy


class VIEW3D_PT_fieldgraft_dataset(bpy.types.Panel):
    bl_label = "Dataset"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Fieldgraft"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.fieldgraft.dataset
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.prop(settings, "folder")
        layout.prop(settings, "source")
        if settings.source == "HEMISPHERE":
            column = layout.column(align=True)
            for name in ("train", "val", "test"):
                column.prop(settings, name)
            column = layout.column(align=True)
            for name in ("width", "height", "angle_x"):
                column.prop(settings, name)
            column = layout.column(align=True)
            for name in ("radius", "centre", "lowest", "highest"):
                column.prop(settings, name)
        layout.operator("fieldgraft.render_dataset", icon="RENDER_STILL")


class VIEW3D_PT_fieldgraft_volume(bpy.types.Panel):
    bl_label = "Volume"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Fieldgraft"

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.operator("fieldgraft.import_volume", icon="VOLUME_DATA")


CLASSES = (VIEW3D_PT_fieldgraft_dataset, VIEW3D_PT_fieldgraft_volume)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
