"""The add-on in a real, headless Blender: registration, cameras, a tiny dataset, a baked volume against a march."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path[:0] = [str(ROOT), str(Path(__file__).resolve().parent)]
import blob  # noqa: E402

from blender_addon import cameras  # noqa: E402

BLENDER = os.environ.get("BLENDER", "blender")  # a Blender, or a Python that has the bpy wheel
needs_blender = pytest.mark.skipif(shutil.which(BLENDER) is None, reason=f"no Blender: {BLENDER} is not on the path")


def blender(script: Path, *arguments: str, resources: Path) -> subprocess.CompletedProcess:
    program = ["-b", "--factory-startup", "--python-exit-code", "1", "--python", str(script), "--"]
    command = [BLENDER, *([str(script), "--"] if Path(BLENDER).name.startswith("python") else program), *arguments]
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(resources)}
    return subprocess.run(command, capture_output=True, text=True, timeout=300, env=environment)


@needs_blender
def test_addon_registers_and_renders_a_dataset(tmp_path: Path) -> None:
    result = blender(ROOT / "tests/blender/inside/check_addon.py", str(tmp_path / "set"), resources=tmp_path)
    assert result.returncode == 0 and "ADDON OK" in result.stdout, result.stdout + result.stderr
    assert sorted(p.name for p in (tmp_path / "set").rglob("*.*")) == [
        "r_000.png",
        "r_001.png",
        "transforms_train.json",
    ]
    for name in ("r_000.png", "r_001.png"):
        picture = np.asarray(Image.open(tmp_path / "set/train" / name))
        assert picture.shape == (32, 32, 4)
        assert picture[16, 16, 3] == 255 and picture[0, 0, 3] == 0  # the cube in the middle, nothing in the corner


def render_blob(folder: Path, view: cameras.View, background: str) -> None:
    k = view.intrinsics
    cameras.write_json(folder / "transforms.json", cameras.synthetic_transforms("test", [view]))
    arguments = [
        "--vdb",
        str(blob.PATH),
        "--cameras",
        str(folder / "transforms.json"),
        "--out",
        str(folder / background),
    ]
    arguments += ["--resolution", str(k.width), str(k.height), "--background", background, "--threads", "1"]
    result = blender(ROOT / "blender_addon/render_volume.py", *arguments, resources=folder)
    assert result.returncode == 0, result.stdout + result.stderr
    done = json.loads([line for line in result.stdout.splitlines() if '"done"' in line][-1])
    assert done["views"] == 1


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    return -10.0 * float(np.log10(np.mean((a - b) ** 2)))


@needs_blender
def test_volume_render_is_the_integral(tmp_path: Path) -> None:
    k = cameras.Intrinsics.from_angle_x(80, 60, 0.75)
    view = cameras.View("v", cameras.look_at((1.6, -2.1, 1.5), (0.1, -0.05, 0.2)), k)
    kinds = ("transparent", "white")
    for kind in kinds:
        render_blob(tmp_path, view, kind)
    names = [name for kind in kinds for name in (str(tmp_path / kind / "v.exr"), str(tmp_path / f"{kind}.raw"))]
    result = blender(ROOT / "tests/blender/inside/dump_pixels.py", *names, resources=tmp_path)
    assert result.returncode == 0, result.stdout + result.stderr

    film = blob.march(np.array(view.matrix), k.width, k.height, k.angle_x, 0.05 * blob.VOXEL)
    alpha = film[..., 3:]
    assert alpha[30, 40, 0] > 0.95 and alpha[0, 0, 0] == 0.0  # the volume is in the picture, and not everywhere
    for kind, expected in {"transparent": film[..., :3], "white": film[..., :3] + 1.0 - alpha}.items():
        raw = np.fromfile(tmp_path / f"{kind}.raw", dtype=np.float32)
        shown = raw.reshape(k.height, k.width, 4).astype(np.float64)
        assert psnr(shown[..., :3], expected) >= 50.0
        if kind == "transparent":
            assert psnr(shown[..., 3:], alpha) >= 50.0
        # The PNG shows the same numbers (straight alpha), with no view transform and no dither between.
        picture = np.asarray(Image.open(tmp_path / kind / "v.png")).astype(np.float64) / 255.0
        straight = shown[..., :3] / np.maximum(shown[..., 3:], 1e-6)
        error = np.abs(picture[..., :3] - np.clip(straight, 0.0, 1.0))
        assert error[alpha[..., 0] > 0.05].max() < 0.75 / 255.0


@needs_blender
@pytest.mark.parametrize(
    ("volume", "size", "message"),
    [("broken.vdb", ["--resolution", "8", "8"], "not a readable .vdb"), ("broken.vdb", [], "give --resolution")],
)
def test_render_volume_refuses_bad_input(tmp_path: Path, volume: str, size: list[str], message: str) -> None:
    view = cameras.View("v", cameras.look_at((0, -3, 1), (0, 0, 0)), cameras.Intrinsics.from_angle_x(8, 8, 0.7))
    cameras.write_json(tmp_path / "transforms.json", cameras.synthetic_transforms("test", [view]))
    (tmp_path / "broken.vdb").write_bytes(b"not a volume")
    arguments = ["--vdb", str(tmp_path / volume), "--cameras", str(tmp_path / "transforms.json")]
    arguments += ["--out", str(tmp_path / "out"), *size]
    result = blender(ROOT / "blender_addon/render_volume.py", *arguments, resources=tmp_path)
    assert result.returncode == 2 and message in result.stderr, result.stdout + result.stderr
    assert not (tmp_path / "out").exists()
