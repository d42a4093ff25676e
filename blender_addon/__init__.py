"""Fieldgraft for Blender: datasets out of scenes, and baked volumes back in. This file registers, nothing else."""

bl_info = {
    "name": "Fieldgraft",
    "author": "The Fieldgraft authors",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "3D View > Sidebar > Fieldgraft",
    "description": "Text-driven, localised editing of neural radiance fields",
    "category": "3D View",
}


def _modules() -> tuple:
    from . import ops, props, ui  # needs bpy: only once Blender asks

    return props, ops, ui


def register() -> None:
    for module in _modules():
        module.register()


def unregister() -> None:
    for module in reversed(_modules()):
        module.unregister()
