"""The add-on's whole state: one PointerProperty on the scene, `Scene.fieldgraft`."""

from __future__ import annotations

import math

import bpy
from bpy.props import EnumProperty, FloatProperty, FloatVectorProperty, IntProperty, PointerProperty, StringProperty


class FieldgraftDataset(bpy.types.PropertyGroup):
    """What `fieldgraft.render_dataset` renders."""

    folder: StringProperty(
        name="Folder", description="Where the pictures and transforms files go", subtype="DIR_PATH", default="//dataset"
    )
    source: EnumProperty(
        name="Cameras",
        items=[
            ("HEMISPHERE", "Hemisphere", "Views spread evenly over the upper hemisphere around a centre"),
            ("SCENE", "Scene cameras", "Every camera of this scene; each eighth is kept for testing"),
            ("ANIMATION", "Animated camera", "The active camera at every frame of the animation"),
        ],
    )
    train: IntProperty(name="Train", description="Number of training views", default=100, min=1, max=10000)
    val: IntProperty(name="Validation", description="Number of validation views", default=8, min=0, max=10000)
    test: IntProperty(name="Test", description="Number of test views", default=16, min=0, max=10000)
    width: IntProperty(name="Width", description="Picture width in pixels", default=400, min=8, max=8192)
    height: IntProperty(name="Height", description="Picture height in pixels", default=400, min=8, max=8192)
    angle_x: FloatProperty(
        name="Field of view", description="Horizontal", subtype="ANGLE", default=math.radians(40), min=0.01, max=3.0
    )
    radius: FloatProperty(
        name="Radius", description="Distance of the cameras from the centre", subtype="DISTANCE", default=4.0, min=1e-3
    )
    centre: FloatVectorProperty(name="Centre", description="What the cameras look at", subtype="XYZ", unit="LENGTH")
    lowest: FloatProperty(
        name="Lowest", description="Lowest elevation", subtype="ANGLE", default=math.radians(5), min=-1.57, max=1.57
    )
    highest: FloatProperty(
        name="Highest", description="Highest elevation", subtype="ANGLE", default=math.radians(85), min=-1.57, max=1.57
    )


class FieldgraftSettings(bpy.types.PropertyGroup):
    dataset: PointerProperty(type=FieldgraftDataset)


CLASSES = (FieldgraftDataset, FieldgraftSettings)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.fieldgraft = PointerProperty(type=FieldgraftSettings)


def unregister() -> None:
    del bpy.types.Scene.fieldgraft
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
