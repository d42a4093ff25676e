"""Fieldgraft: text-driven, localised editing of neural radiance fields.

    import fieldgraft as fg
    scene = fg.Scene.load("scene")
    field = fg.train(scene, minutes=5, progress=print)
    edit = fg.edit(field, source="bulldozer", target="red bulldozer", ops={"change"}, scene=scene)
    image = fg.render(field, [edit], scene.cameras("test")[0])
    fg.bake(field, [edit], "out.vdb", resolution=256)

Arrays are NumPy float32; pictures are H×W×C (or N×H×W×C) in [0, 1]; cameras stand in the user's world. Bad input raises
InputError (a ValueError) with one line that says what, where, and what would be right.
"""

import os

# As the program does (core/base/process.h); OpenMP reads it when it is loaded.
if "OMP_WAIT_POLICY" not in os.environ:
    os.environ.setdefault("GOMP_SPINCOUNT", "2000")

from fieldgraft._core import (  # noqa: E402
    Camera,
    Cancelled,
    Edit,
    Failure,
    Field,
    Guidance,
    InputError,
    Scene,
    Tokenizer,
    bake,
    blend,
    render,
    train,
)
from fieldgraft.editing import builtin_model, edit

__all__ = [
    "Camera",
    "Cancelled",
    "Edit",
    "Failure",
    "Field",
    "Guidance",
    "InputError",
    "Scene",
    "Tokenizer",
    "bake",
    "blend",
    "builtin_model",
    "edit",
    "render",
    "train",
]
