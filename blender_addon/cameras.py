"""Cameras: hemisphere views, a Blender scene's own cameras, and the files they are written to and read from.

Matrices are camera-to-world, 4×4, row-major nested lists, OpenGL axes (the camera looks along its −Z, +Y is up), in
Blender's world (Z up) and its units: what `Object.matrix_world` of a camera is, and what NeRF-synthetic and nerfstudio
`transforms.json` hold. Intrinsics are in pixels, the principal point from the left and the *top* edge.

Everything down to "Blender's side" is plain Python without bpy or NumPy, so that it can be tested anywhere and runs in
every Blender (some are built without NumPy). Sensor rules are those of Blender's camera model: with fit AUTO the larger
side of the picture decides, shifts are shares of the fitted side.
"""

from __future__ import annotations

import json
import math
import os
import re
import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Matrix = list[list[float]]
GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))


@dataclass(frozen=True)
class Intrinsics:
    """A pinhole camera's picture: size and focal lengths in pixels, principal point from the top left corner."""

    width: int
    height: int
    fl_x: float
    fl_y: float
    cx: float
    cy: float

    @staticmethod
    def from_angle_x(width: int, height: int, angle_x: float) -> Intrinsics:
        """Square pixels, principal point in the middle, `angle_x` the horizontal field of view in radians."""
        if not 0.0 < angle_x < math.pi:
            raise ValueError(f"camera_angle_x is {angle_x}: it must lie between 0 and pi")
        focal = 0.5 * width / math.tan(0.5 * angle_x)
        return Intrinsics(width, height, focal, focal, 0.5 * width, 0.5 * height)

    @property
    def angle_x(self) -> float:
        return 2.0 * math.atan(0.5 * self.width / self.fl_x)

    @property
    def is_simple(self) -> bool:
        """Square pixels and a centred principal point: all that camera_angle_x can say."""
        tolerance = 1e-4 * max(self.width, self.height)
        centred = abs(self.cx - 0.5 * self.width) < tolerance and abs(self.cy - 0.5 * self.height) < tolerance
        return centred and abs(self.fl_x - self.fl_y) < 1e-5 * self.fl_x

    def scaled_to(self, width: int, height: int) -> Intrinsics:
        """The same view in another picture size."""
        sx, sy = width / self.width, height / self.height
        return Intrinsics(width, height, self.fl_x * sx, self.fl_y * sy, self.cx * sx, self.cy * sy)


@dataclass(frozen=True)
class View:
    """One camera: its name (also the picture's), its pose and its picture."""

    name: str
    matrix: Matrix
    intrinsics: Intrinsics


def _normalised(vector: Sequence[float]) -> list[float]:
    length = math.sqrt(sum(x * x for x in vector))
    if length < 1e-12:
        raise ValueError(f"cannot normalise the vector {list(vector)}: its length is {length}")
    return [x / length for x in vector]


def _cross(a: Sequence[float], b: Sequence[float]) -> list[float]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def look_at(position: Sequence[float], target: Sequence[float], up: Sequence[float] = (0.0, 0.0, 1.0)) -> Matrix:
    """The pose at `position` whose −Z axis points to `target`; straight up or down, +Y stands in for up."""
    backward = _normalised([p - t for p, t in zip(position, target, strict=True)])
    if abs(sum(b * u for b, u in zip(backward, _normalised(up), strict=True))) > 1.0 - 1e-9:
        up = (0.0, 1.0, 0.0)
    right = _normalised(_cross(up, backward))
    true_up = _cross(backward, right)
    rows = [[right[i], true_up[i], backward[i], float(position[i])] for i in range(3)]
    return [*rows, [0.0, 0.0, 0.0, 1.0]]


def hemisphere_positions(
    count: int, radius: float, centre: Sequence[float], elevation: tuple[float, float], phase: float = 0.0
) -> list[list[float]]:
    """`count` points spread evenly over the band of a sphere between two elevations (radians): a golden-angle spiral.

    Uniform by area: the sine of the elevation runs evenly over the band. `phase` in turns rotates the spiral, so that
    the views of different splits fall between each other.
    """
    if count < 1:
        raise ValueError(f"{count} views asked for: at least 1 is needed")
    if not radius > 0.0:
        raise ValueError(f"the radius is {radius}: it must be positive")
    low, high = math.sin(elevation[0]), math.sin(elevation[1])
    points = []
    for i in range(count):
        z = low + (high - low) * (i + 0.5) / count
        around = math.sqrt(max(0.0, 1.0 - z * z))
        angle = GOLDEN_ANGLE * i + 2.0 * math.pi * phase
        offset = (around * math.cos(angle), around * math.sin(angle), z)
        points.append([c + radius * o for c, o in zip(centre, offset, strict=True)])
    return points


# Where each split's spiral starts, in turns: irrational shares, so that no test view repeats a training view.
SPLIT_PHASES = {"train": 0.0, "val": 0.381966, "test": 0.723607}


def hemisphere_views(
    counts: dict[str, int],
    intrinsics: Intrinsics,
    radius: float,
    centre: Sequence[float] = (0.0, 0.0, 0.0),
    elevation: tuple[float, float] = (math.radians(5.0), math.radians(85.0)),
) -> dict[str, list[View]]:
    """Views over the upper hemisphere looking at `centre`, one list a split; splits with a count of 0 are left out."""
    splits = {}
    for split, count in counts.items():
        if count == 0:
            continue
        points = hemisphere_positions(count, radius, centre, elevation, SPLIT_PHASES.get(split, 0.0))
        splits[split] = [View(f"r_{i:03d}", look_at(point, centre), intrinsics) for i, point in enumerate(points)]
    return splits


def split_views(views: Sequence[View], every: int = 8) -> dict[str, list[View]]:
    """Scene cameras into train and test: every `every`-th view is held out when there are enough to spare."""
    if len(views) < every:
        return {"train": list(views)}
    test = [view for i, view in enumerate(views) if i % every == every // 2]
    return {"train": [view for view in views if view not in test], "test": test}


# ---- Files ----------------------------------------------------------------------------------------------------------


def write_json(path: str | os.PathLike, value: Any) -> None:
    """Written under a temporary name beside `path`, then renamed: the file is whole or absent."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(path.name + ".part")
    temporary.write_text(json.dumps(value, indent=1) + "\n", encoding="utf-8")
    os.replace(temporary, path)


def _rounded(matrix: Matrix) -> Matrix:
    return [[round(x, 9) + 0.0 for x in row] for row in matrix]


def synthetic_transforms(split: str, views: Sequence[View]) -> dict[str, Any]:
    """One split in the NeRF-synthetic form (file_path without extension); the views share simple intrinsics."""
    first = views[0].intrinsics
    if not first.is_simple or any(view.intrinsics != first for view in views):
        raise ValueError("the NeRF-synthetic form holds one field of view with square pixels: use the nerfstudio form")
    frames = [{"file_path": f"./{split}/{v.name}", "transform_matrix": _rounded(v.matrix)} for v in views]
    return {"camera_angle_x": first.angle_x, "frames": frames}


def nerfstudio_transforms(splits: dict[str, list[View]]) -> dict[str, Any]:
    """All splits in one nerfstudio transforms.json, intrinsics per frame, the splits as lists of file names."""
    result: dict[str, Any] = {"camera_model": "OPENCV", "frames": []}
    for split, views in splits.items():
        names = []
        for view in views:
            k = view.intrinsics
            names.append(f"{split}/{view.name}.png")
            result["frames"].append(
                {
                    "file_path": names[-1],
                    **{"w": k.width, "h": k.height, "fl_x": k.fl_x, "fl_y": k.fl_y, "cx": k.cx, "cy": k.cy},
                    "transform_matrix": _rounded(view.matrix),
                }
            )
        result[f"{split}_filenames"] = names
    return result


def write_dataset_files(folder: str | os.PathLike, splits: dict[str, list[View]]) -> list[Path]:
    """transforms_{split}.json where that form can say it all, else one transforms.json; returns what was written."""
    views = [view for split in splits.values() for view in split]
    if not views:
        raise ValueError("a dataset needs at least one view")
    folder = Path(folder)
    if views[0].intrinsics.is_simple and all(view.intrinsics == views[0].intrinsics for view in views):
        paths = [folder / f"transforms_{split}.json" for split in splits]
        for path, (split, of_split) in zip(paths, splits.items(), strict=True):
            write_json(path, synthetic_transforms(split, of_split))
        return paths
    write_json(folder / "transforms.json", nerfstudio_transforms(splits))
    return [folder / "transforms.json"]


def _matrix_of(value: Any, where: str) -> Matrix:
    """4×4 rows, 3×4 rows or 16 numbers row-major; a string of 16 numbers is column-major (nerfstudio's add-on)."""
    if isinstance(value, str):
        numbers = [float(x) for x in value.strip("[] \n").split(",")]
        if len(numbers) == 16:
            value = [[numbers[4 * column + row] for column in range(4)] for row in range(4)]
    elif isinstance(value, list) and len(value) == 16:
        value = [value[4 * row : 4 * row + 4] for row in range(4)]
    if not isinstance(value, list) or len(value) not in (3, 4) or any(len(row) != 4 for row in value):
        raise ValueError(f"{where}: a camera matrix must be 4×4 numbers")
    rows = [[float(x) for x in row] for row in value]
    if not all(math.isfinite(x) for row in rows for x in row):
        raise ValueError(f"{where}: the camera matrix holds a number that is not finite")
    return rows if len(rows) == 4 else [*rows, [0.0, 0.0, 0.0, 1.0]]


def _intrinsics_of_json(shared: dict, frame: dict, size: tuple[int, int] | None, where: str) -> Intrinsics:
    known = {**shared, **frame}
    width = int(known["w"]) if "w" in known else size[0] if size else 0
    height = int(known["h"]) if "h" in known else size[1] if size else 0
    if width < 1 or height < 1:
        raise ValueError(f"{where}: no picture size in the file; give --resolution W H")
    if "fl_x" in known:
        fl_x = float(known["fl_x"])
        cx, cy = float(known.get("cx", 0.5 * width)), float(known.get("cy", 0.5 * height))
        return Intrinsics(width, height, fl_x, float(known.get("fl_y", fl_x)), cx, cy)
    if "camera_angle_x" in known:
        return Intrinsics.from_angle_x(width, height, float(known["camera_angle_x"]))
    raise ValueError(f"{where}: neither fl_x nor camera_angle_x says how wide the camera sees")


def png_size(path: Path) -> tuple[int, int] | None:
    """Width and height out of a PNG's header; None when there is no such picture."""
    try:
        with open(path, "rb") as file:
            head = file.read(24)
    except OSError:
        return None
    if head[:8] != b"\x89PNG\r\n\x1a\n" or head[12:16] != b"IHDR":
        return None
    return struct.unpack(">II", head[16:24])


def _picture_size_beside(path: Path, frame: dict) -> tuple[int, int] | None:
    """The size of the frame's own picture, when it is a PNG inside the file's folder (extension or none)."""
    name = Path(str(frame.get("file_path", "")))
    if name.is_absolute() or ".." in name.parts:
        return None
    return png_size(path.parent / name) or png_size(path.parent / f"{name}.png")


def _views_of_path(data: dict, where: str) -> Iterable[View]:
    """nerfstudio's camera_path.json: the interpolated cameras, or the key frames where there are none."""
    width, height = int(data["render_width"]), int(data["render_height"])
    poses = data.get("camera_path") or data.get("keyframes") or []
    for i, pose in enumerate(poses):
        focal = 0.5 * height / math.tan(0.5 * math.radians(float(pose.get("fov", data.get("default_fov", 50.0)))))
        key = "camera_to_world" if "camera_to_world" in pose else "matrix"
        matrix = _matrix_of(pose.get(key), f"{where}, camera {i}")
        yield View(f"{i:05d}", matrix, Intrinsics(width, height, focal, focal, 0.5 * width, 0.5 * height))


def read_views(
    path: str | os.PathLike, size: tuple[int, int] | None = None, fallback: tuple[int, int] | None = None
) -> list[View]:
    """The cameras of a transforms*.json (NeRF-synthetic or nerfstudio) or a nerfstudio camera path, in file order.

    `size` (width, height) is the size of the dataset's pictures where the file does not say it; without it, that of the
    first picture beside the file; without pictures, `fallback`.
    Raises ValueError with one line that names the file and the frame.
    """
    path = Path(path)
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: cannot be read as JSON ({error})") from error
    if isinstance(data, dict) and ("camera_path" in data or "keyframes" in data):
        views = list(_views_of_path(data, str(path)))
    elif isinstance(data, dict) and isinstance(data.get("frames"), list):
        views = []
        for i, frame in enumerate(data["frames"]):
            where = f"{path}, frame {i}"
            name = Path(str(frame.get("file_path", f"{i:05d}"))).with_suffix("").name
            matrix = _matrix_of(frame.get("transform_matrix"), where)
            size = size or _picture_size_beside(path, frame) or fallback
            views.append(View(name, matrix, _intrinsics_of_json(data, frame, size, where)))
    else:
        raise ValueError(f"{path}: neither a transforms.json (frames) nor a camera path (camera_path) is in it")
    if not views:
        raise ValueError(f"{path}: no cameras in it")
    return views


# ---- Blender's side -------------------------------------------------------------------------------------------------


def picture_size(render: Any) -> tuple[int, int]:
    share = render.resolution_percentage / 100.0
    return int(render.resolution_x * share), int(render.resolution_y * share)


def intrinsics_of(camera_data: Any, render: Any) -> Intrinsics:
    """The pinhole a Blender perspective camera is, for the scene's picture size and pixel aspect."""
    if camera_data.type != "PERSP":
        raise ValueError(f'camera "{camera_data.name}" is of type {camera_data.type}: only perspective cameras work')
    width, height = picture_size(render)
    aspect = render.pixel_aspect_y / render.pixel_aspect_x
    fit = camera_data.sensor_fit
    if fit == "AUTO":
        fit = "HORIZONTAL" if width >= height * aspect else "VERTICAL"
        sensor = camera_data.sensor_width  # AUTO measures the larger side with the sensor's width
    else:
        sensor = camera_data.sensor_width if fit == "HORIZONTAL" else camera_data.sensor_height
    fitted = width if fit == "HORIZONTAL" else height * aspect  # in pixels of x
    fl_x = camera_data.lens / sensor * fitted
    cx = 0.5 * width - camera_data.shift_x * fitted
    cy = 0.5 * height + camera_data.shift_y * fitted / aspect
    return Intrinsics(width, height, fl_x, fl_x / aspect, cx, cy)


def apply_view(scene: Any, camera_object: Any, view: View) -> None:
    """Makes `camera_object` see exactly what `view` says, and gives the scene its picture size."""
    from mathutils import Matrix as BlenderMatrix

    k, data, render = view.intrinsics, camera_object.data, scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = k.width, k.height, 100
    # Blender allows pixel aspects of 1 and above only: widen the other side where pixels are tall.
    render.pixel_aspect_x, render.pixel_aspect_y = max(1.0, k.fl_y / k.fl_x), max(1.0, k.fl_x / k.fl_y)
    data.type, data.sensor_fit = "PERSP", "HORIZONTAL"
    data.lens = data.sensor_width * k.fl_x / k.width
    aspect = render.pixel_aspect_y / render.pixel_aspect_x
    data.shift_x = -(k.cx - 0.5 * k.width) / k.width
    data.shift_y = (k.cy - 0.5 * k.height) * aspect / k.width
    camera_object.matrix_world = BlenderMatrix(view.matrix)


def new_camera(scene: Any, name: str = "Fieldgraft camera") -> Any:
    """A perspective camera linked to the scene, with no depth of field and generous clipping."""
    import bpy

    camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    camera.data.clip_start, camera.data.clip_end = 1e-3, 1e4
    scene.collection.objects.link(camera)
    return camera


def _rigid(matrix: Any) -> Matrix:
    """A camera's world matrix without the scale that Blender ignores in it."""
    location, rotation, _ = matrix.decompose()
    rows = rotation.to_matrix()
    return [*[[*rows[i], location[i]] for i in range(3)], [0.0, 0.0, 0.0, 1.0]]


def scene_views(scene: Any, frames: Iterable[int] | None = None) -> list[View]:
    """Every camera of the scene as a view; with `frames`, the active camera at each of these animation frames."""
    if frames is None:
        cameras = sorted((o for o in scene.objects if o.type == "CAMERA"), key=lambda o: o.name)
        names = [f"{i:03d}_" + re.sub(r"[^A-Za-z0-9_-]+", "_", o.name) for i, o in enumerate(cameras)]
        return [
            View(name, _rigid(o.matrix_world), intrinsics_of(o.data, scene.render))
            for name, o in zip(names, cameras, strict=True)
        ]
    if scene.camera is None:
        raise ValueError("the scene has no active camera")
    before, views = scene.frame_current, []
    for number in frames:
        scene.frame_set(number)
        intrinsics = intrinsics_of(scene.camera.data, scene.render)
        views.append(View(f"f_{number:05d}", _rigid(scene.camera.matrix_world), intrinsics))
    scene.frame_set(before)
    return views
