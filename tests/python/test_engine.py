"""The Python package from a scene to a volume: what the README's example does, at a size that takes seconds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

fg = pytest.importorskip("fieldgraft", reason="the Python package is not built: ./dev build")

ROOT = Path(__file__).resolve().parents[2]
SCENE = ROOT / "demo" / "scene"


@pytest.fixture(scope="module")
def scene():
    return fg.Scene.load(SCENE, downscale=4)


@pytest.fixture(scope="module")
def trained(scene):
    events: list[dict] = []
    return fg.train(scene, iterations=60, progress=events.append), events


@pytest.fixture(scope="module")
def field(trained):
    return trained[0]


@pytest.fixture(scope="module")
def red(scene, field, tmp_path_factory):
    """An edit of what a drawn mask shows: the built-in segmenter is not asked."""
    from PIL import Image

    view = scene.cameras("train")[0]
    mask = np.zeros((view.height, view.width), np.uint8)
    mask[view.height // 3 : -view.height // 3, view.width // 3 : -view.width // 3] = 255
    path = tmp_path_factory.mktemp("masks") / "mask.png"
    Image.fromarray(mask).save(path)
    return fg.edit(
        field,
        source="yellow monkey",
        target="red monkey",
        ops={"change"},
        scene=scene,
        masks={f"train/{view.name}": path},
        mask_only=True,
        iterations=3,
        patch=32,
        augmentations=2,
    )


def test_cameras_stand_in_the_users_world(scene) -> None:
    camera = scene.cameras("test")[0]
    again = fg.Camera(
        camera.width, camera.height, camera.fx, camera.camera_to_world, fy=camera.fy, cx=camera.cx, cy=camera.cy
    )
    assert np.array_equal(again.camera_to_world, camera.camera_to_world)
    half = camera.resized(camera.width // 2, camera.height // 2)
    assert half.fx == pytest.approx(camera.fx / 2)
    with pytest.raises(ValueError, match="4×4"):
        fg.Camera(8, 8, 10.0, np.eye(3))


def test_training_reports_and_learns(scene, trained) -> None:
    field, events = trained
    done = events[-1]
    assert done["event"] == "done" and done["iterations"] == 60
    assert {e["event"] for e in events} >= {"progress", "done"}
    camera = scene.cameras("test")[0]
    truth = scene.image(camera.name, "test")
    truth = truth[..., :3] * truth[..., 3:] + 1 - truth[..., 3:]
    drawn = fg.render(field, [], camera)
    assert drawn.shape == truth.shape and drawn.dtype == np.float32
    grey = np.mean((truth - truth.mean((0, 1))) ** 2)
    assert np.mean((drawn - truth) ** 2) < 0.9 * grey  # a haze of the right colours in the right places


def test_false_from_the_callback_stops_training(scene) -> None:
    with pytest.raises(fg.Cancelled):
        fg.train(scene, iterations=10_000, progress=lambda event: False)


def test_an_exception_in_the_callback_comes_out(scene) -> None:
    def broken(event: dict) -> None:
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        fg.train(scene, iterations=10_000, progress=broken)


def test_field_file_round_trip(field, tmp_path) -> None:
    field.save(tmp_path / "field.safetensors")
    assert fg.Field.load(tmp_path / "field.safetensors").hash() == field.hash()
    with pytest.raises(fg.InputError):
        fg.Field.load(tmp_path / "missing.safetensors")


def test_edit_render_and_bake(scene, field, red, tmp_path) -> None:
    camera = scene.cameras("test")[0]
    plain = fg.render(field, [], camera)
    maps = fg.render(field, [red], camera, maps=True, background="transparent")
    assert maps.shape == (camera.height, camera.width, 7)
    assert maps[..., 4].max() == 0 and maps[..., 5].max() == 0  # nothing added or removed
    red.strength_change = 0.0
    assert np.array_equal(fg.render(field, [red], camera), plain)
    red.strength_change = 1.0
    with pytest.raises(ValueError, match="only change"):
        red.strength_add = 0.5
    figures = fg.bake(field, [red], tmp_path / "out.vdb", resolution=32)
    assert figures["voxels"] > 0 and (tmp_path / "out.vdb").stat().st_size == figures["bytes"]


def test_edit_file_round_trip(field, red, tmp_path) -> None:
    red.save(tmp_path / "edit.safetensors")
    again = fg.Edit.load(tmp_path / "edit.safetensors")
    assert again.hash() == red.hash() and again.field_hash == field.hash()
    assert again.specification["target"] == "red monkey" and again.operations == "change"


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"ops": {"paint"}}, "paint"),
        ({"ops": {"change"}, "preset": "best"}, "best"),
        ({"ops": {"change"}, "colour": 3}, "colour"),
        ({"ops": {"change"}, "mask_only": True}, "masks"),
        ({"ops": {"change"}, "guidance": "no/such/folder"}, "no/such/folder"),
    ],
)
def test_bad_edits_say_so(field, settings: dict, message: str) -> None:
    with pytest.raises(fg.InputError, match=message):
        fg.edit(field, source="yellow monkey", target="red monkey", **settings)


def test_a_missing_builtin_model_is_named(monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("FIELDGRAFT_MODELS", str(tmp_path))
    with pytest.raises(fg.InputError, match=str(tmp_path)):
        fg.builtin_model("guide")
