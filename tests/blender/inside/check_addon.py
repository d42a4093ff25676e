"""Inside Blender: the add-on registers, cameras are read back, a tiny dataset is rendered. Argument: a folder."""

import math
import sys
from pathlib import Path

import bpy  # first: the wheel makes addon_utils importable

import addon_utils  # isort: skip

ROOT = Path(__file__).resolve().parent.parent.parent.parent
sys.path.insert(0, str(ROOT))
folder = Path(sys.argv[sys.argv.index("--") + 1])
assert addon_utils.enable("blender_addon", default_set=False) is not None, "the add-on does not register"
from blender_addon import cameras, dataset  # noqa: E402

scene = bpy.context.scene
assert hasattr(scene, "fieldgraft") and hasattr(bpy.types, "VIEW3D_PT_fieldgraft_dataset")


def close(a: object, b: object, tolerance: float = 2e-5) -> bool:
    if isinstance(a, list):
        return len(a) == len(b) and all(close(x, y, tolerance) for x, y in zip(a, b, strict=True))
    return abs(a - b) <= tolerance * max(1.0, abs(a), abs(b))


def projected(camera: bpy.types.Object, point: tuple[float, float, float]) -> list[float]:
    """Where Blender's own projection matrix puts a world point, in pixels from the top left."""
    from mathutils import Vector

    bpy.context.view_layer.update()
    render = scene.render
    width, height = cameras.picture_size(render)
    projection = camera.calc_matrix_camera(
        bpy.context.evaluated_depsgraph_get(),
        x=width,
        y=height,
        scale_x=render.pixel_aspect_x,
        scale_y=render.pixel_aspect_y,
    )
    x, y, _, w = projection @ camera.matrix_world.inverted() @ Vector((*point, 1.0))
    return [width * (0.5 + 0.5 * x / w), height * (0.5 - 0.5 * y / w)]


def pinhole(view: cameras.View, point: tuple[float, float, float]) -> list[float]:
    """Where the written intrinsics and pose put it."""
    offset = [p - view.matrix[i][3] for i, p in enumerate(point)]
    x, y, z = (sum(view.matrix[row][column] * offset[row] for row in range(3)) for column in range(3))
    k = view.intrinsics
    return [k.cx + k.fl_x * x / -z, k.cy - k.fl_y * y / -z]


# Views set on a camera are what is read back from it, and what Blender itself projects by.
pose = cameras.look_at((2.0, -3.0, 1.5), (0.1, 0.2, 0.0))
camera = cameras.new_camera(scene)
with dataset.kept_settings(scene):
    for k in (
        cameras.Intrinsics.from_angle_x(64, 48, 0.7),
        cameras.Intrinsics(48, 64, 70.0, 70.0, 20.0, 37.0),
        cameras.Intrinsics(64, 48, 70.0, 55.0, 30.0, 25.5),
        cameras.Intrinsics(64, 48, 55.0, 70.0, 35.0, 22.0),
    ):
        view = cameras.View("v", pose, k)
        cameras.apply_view(scene, camera, view)
        bpy.context.view_layer.update()
        read = cameras.intrinsics_of(camera.data, scene.render)
        for name in ("width", "height", "fl_x", "fl_y", "cx", "cy"):
            assert close(getattr(k, name), getattr(read, name)), (name, k, read)
        for point in ((0.0, 0.0, 0.0), (0.4, -0.3, 0.5)):
            assert close(projected(camera, point), pinhole(view, point), 1e-4), (k, projected(camera, point))

    # Every way Blender has to fit a sensor, read and checked against its projection.
    for fit, width, height in (("AUTO", 60, 90), ("AUTO", 90, 60), ("VERTICAL", 90, 60), ("HORIZONTAL", 60, 90)):
        scene.render.resolution_x, scene.render.resolution_y = width, height
        scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = 1.0, 1.5
        data = camera.data
        data.sensor_fit, data.sensor_width, data.sensor_height, data.lens = fit, 36.0, 20.0, 40.0
        data.shift_x, data.shift_y = 0.05, -0.08
        view = cameras.View("v", pose, cameras.intrinsics_of(data, scene.render))
        assert close(projected(camera, (0.4, -0.3, 0.5)), pinhole(view, (0.4, -0.3, 0.5)), 1e-4), (fit, width, height)


def state() -> tuple:
    render = scene.render
    return render.resolution_x, render.film_transparent, render.filepath, scene.camera, len(bpy.data.cameras)


# The operator: bad input is refused, a good one renders.
settings = scene.fieldgraft.dataset
settings.folder = "//relative"
try:
    result = bpy.ops.fieldgraft.render_dataset()
    assert result == {"CANCELLED"}, result
except RuntimeError as error:  # scripts see a reported ERROR as an exception
    assert "save the file first" in str(error), error
settings.folder = str(folder)
settings.train, settings.val, settings.test, settings.width, settings.height = 2, 0, 0, 32, 32
settings.radius, settings.angle_x, settings.centre = 5.0, 0.6, (0.0, 0.0, 0.1)
scene.render.engine = "CYCLES"
scene.cycles.samples = 4
before = state()
assert bpy.ops.fieldgraft.render_dataset() == {"FINISHED"}
assert state() == before, (before, state())

views = cameras.read_views(folder / "transforms_train.json", (32, 32))
planned = cameras.hemisphere_views(
    {"train": 2},
    cameras.Intrinsics.from_angle_x(32, 32, 0.6),
    5.0,
    (0.0, 0.0, 0.1),
    (math.radians(5.0), math.radians(85.0)),
)
for read, wanted in zip(views, planned["train"], strict=True):
    assert close(read.matrix, wanted.matrix) and abs(read.intrinsics.fl_x - wanted.intrinsics.fl_x) < 1e-2

# The scene's own cameras, the operator's second source.
settings.source = "SCENE"
from blender_addon import ops  # noqa: E402

assert [len(v) for v in ops.planned_views(scene).values()] == [2]

addon_utils.disable("blender_addon", default_set=False)
assert not hasattr(bpy.types.Scene, "fieldgraft") and not hasattr(bpy.types, "FIELDGRAFT_OT_render_dataset")
print("ADDON OK")
