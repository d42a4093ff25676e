"""The add-on's camera arithmetic and files, without Blender."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT))
from blender_addon import cameras  # noqa: E402


def test_look_at_is_a_rotation_that_looks_at_the_target() -> None:
    for position, target in [((1, 2, 3), (0, 0, 0)), ((0, 0, 5), (0, 0, 1)), ((0.1, -4, -1), (0.3, 0.2, 0.1))]:
        pose = np.array(cameras.look_at(position, target))
        rotation = pose[:3, :3]
        np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        forward = np.array(target, float) - np.array(position, float)
        np.testing.assert_allclose(-rotation[:, 2], forward / np.linalg.norm(forward), atol=1e-12)
        assert rotation[2, 1] >= -1e-12  # up is up
    with pytest.raises(ValueError, match="length is 0"):
        cameras.look_at((1, 1, 1), (1, 1, 1))


def test_hemisphere_is_even_and_bounded() -> None:
    centre, low, high = (0.5, -1.0, 2.0), math.radians(5), math.radians(80)
    points = np.array(cameras.hemisphere_positions(2000, 3.0, centre, (low, high))) - centre
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 3.0)
    heights = points[:, 2] / 3.0
    assert heights.min() >= math.sin(low) and heights.max() <= math.sin(high)
    # Even by area: heights uniform, azimuths uniform.
    assert np.histogram(heights, 10, (math.sin(low), math.sin(high)))[0] == pytest.approx(200, abs=2)
    azimuths = np.arctan2(points[:, 1], points[:, 0])
    assert np.histogram(azimuths, 8, (-math.pi, math.pi))[0] == pytest.approx(250, abs=10)
    with pytest.raises(ValueError, match="at least 1"):
        cameras.hemisphere_positions(0, 3.0, centre, (low, high))


def test_splits_do_not_share_cameras() -> None:
    intrinsics = cameras.Intrinsics.from_angle_x(64, 64, 0.7)
    splits = cameras.hemisphere_views({"train": 60, "val": 8, "test": 8}, intrinsics, 4.0)
    position = {s: np.array([[row[3] for row in v.matrix[:3]] for v in views]) for s, views in splits.items()}
    for held_out in ("val", "test"):
        gaps = np.linalg.norm(position[held_out][:, None] - position["train"][None], axis=-1).min(axis=1)
        assert gaps.min() > 0.05


@pytest.mark.parametrize("simple", [True, False])
def test_written_cameras_are_read_back(tmp_path: Path, simple: bool) -> None:
    k = cameras.Intrinsics.from_angle_x(64, 48, 0.7) if simple else cameras.Intrinsics(64, 48, 70, 72, 30.5, 25)
    splits = cameras.hemisphere_views({"train": 5, "test": 2}, k, 4.0)
    paths = cameras.write_dataset_files(tmp_path, splits)
    names = ["transforms_train.json", "transforms_test.json"] if simple else ["transforms.json"]
    assert [p.name for p in paths] == names and not list(tmp_path.glob("*.part"))
    views = [view for path in paths for view in cameras.read_views(path, (64, 48))]
    for read, written in zip(views, [v for s in splits.values() for v in s], strict=True):
        assert read.name == written.name
        np.testing.assert_allclose(read.matrix, written.matrix, atol=1e-8)
        for name in ("width", "height", "fl_x", "fl_y", "cx", "cy"):
            assert getattr(read.intrinsics, name) == pytest.approx(getattr(k, name), rel=1e-9)


def test_picture_size_comes_from_the_pictures(tmp_path: Path) -> None:
    splits = cameras.hemisphere_views({"test": 2}, cameras.Intrinsics.from_angle_x(40, 30, 0.7), 4.0)
    (path,) = cameras.write_dataset_files(tmp_path, splits)
    with pytest.raises(ValueError, match="give --resolution"):
        cameras.read_views(path)
    (tmp_path / "test").mkdir()
    Image.new("RGBA", (40, 30)).save(tmp_path / "test" / "r_000.png")
    assert {(v.intrinsics.width, v.intrinsics.height) for v in cameras.read_views(path)} == {(40, 30)}


def test_camera_paths_in_both_forms(tmp_path: Path) -> None:
    pose = cameras.look_at((1, -3, 2), (0, 0, 0))
    flat = [x for row in pose for x in row]
    columns = ", ".join(str(pose[row][column]) for column in range(4) for row in range(4))
    fov = math.degrees(2 * math.atan(0.5 * 480 / 600))
    head = {"render_width": 640, "render_height": 480}
    viewer = {**head, "camera_path": [{"camera_to_world": flat, "fov": fov, "aspect": 4 / 3}], "keyframes": []}
    addon = {**head, "camera_path": [], "keyframes": [{"matrix": f"[{columns}]", "fov": fov, "aspect": 4 / 3}]}
    for i, data in enumerate((viewer, addon)):
        (tmp_path / f"{i}.json").write_text(json.dumps(data))
        (view,) = cameras.read_views(tmp_path / f"{i}.json")
        np.testing.assert_allclose(view.matrix, pose, atol=1e-12)
        assert view.intrinsics.fl_x == pytest.approx(600) and view.intrinsics.cx == 320


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "cannot be read as JSON"),
        ("{}", "neither a transforms.json"),
        ('{"frames": [], "camera_angle_x": 0.7}', "no cameras"),
        ('{"frames": [{"transform_matrix": [[1, 0], [0, 1]]}], "camera_angle_x": 0.7}', "frame 0: .* 4×4"),
        ('{"frames": [{"transform_matrix": [[NaN,0,0,0],[0,1,0,0],[0,0,1,0]]}], "camera_angle_x": 0.7}', "not finite"),
        ('{"frames": [{"transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0]]}]}', "neither fl_x nor camera_angle_x"),
        (
            '{"frames": [{"transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0]]}], "camera_angle_x": 9}',
            "between 0 and pi",
        ),
    ],
)
def test_broken_files_get_one_line(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "t.json").write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        cameras.read_views(tmp_path / "t.json", (8, 8))
    assert "\n" not in str(caught.value)


def test_every_eighth_scene_camera_is_held_out() -> None:
    k = cameras.Intrinsics.from_angle_x(8, 8, 0.7)
    views = [cameras.View(f"{i:03d}", cameras.look_at((4, i, 1), (0, 0, 0)), k) for i in range(20)]
    splits = cameras.split_views(views)
    assert [v.name for v in splits["test"]] == ["004", "012"] and len(splits["train"]) == 18
    assert list(cameras.split_views(views[:5])) == ["train"]
