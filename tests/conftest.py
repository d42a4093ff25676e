"""What every Python test shares: where the program is, a tiny scene made on the spot, and running commands."""

from __future__ import annotations

import json
import math
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
PRESET = os.environ.get("FIELDGRAFT_PRESET", "release")
PROGRAM = ROOT / "build" / PRESET / "fieldgraft"


@pytest.fixture(scope="session", autouse=True)
def no_measured_machine(tmp_path_factory: pytest.TempPathFactory) -> None:
    """What the user's machine was measured to be changes what training chooses."""
    os.environ["XDG_CACHE_HOME"] = str(tmp_path_factory.mktemp("cache"))


def run_program(*arguments: object, timeout: float = 300) -> subprocess.CompletedProcess:
    command = [str(PROGRAM), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=timeout)


def events_of(result: subprocess.CompletedProcess) -> list[dict]:
    assert result.returncode == 0, result.stderr
    return [json.loads(line) for line in result.stdout.splitlines()]


def look_at_origin(azimuth: float, elevation: float, radius: float) -> np.ndarray:
    """Camera-to-world, OpenGL axes, Z up, looking at the origin."""
    eye = radius * np.array(
        [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)]
    )
    back = eye / np.linalg.norm(eye)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = right, np.cross(back, right), back, eye
    return pose


def ball_picture(pose: np.ndarray, size: int, focal: float, radius: float = 0.7) -> np.ndarray:
    """A ball, red above and yellow below, shaded by its normal; straight alpha."""
    y, x = np.mgrid[0:size, 0:size]
    local = np.stack([(x + 0.5 - size / 2) / focal, -(y + 0.5 - size / 2) / focal, -np.ones((size, size))], -1)
    ray = local @ pose[:3, :3].T
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    eye = pose[:3, 3]
    half_b = ray @ eye
    root = half_b**2 - (eye @ eye - radius**2)
    hit = root > 0
    point = eye + ray * (-half_b - np.sqrt(np.where(hit, root, 0)))[..., None]
    normal = point / radius
    color = np.where(point[..., 2:] > 0, np.array([0.8, 0.1, 0.1]), np.array([0.9, 0.8, 0.1]))
    shade = 0.6 + 0.4 * np.clip(normal @ np.array([0.3, 0.2, 0.93]), 0, 1)
    rgba = np.concatenate([color * shade[..., None], hit[..., None].astype(float)], -1)
    rgba[~hit] = 0
    return (rgba * 255 + 0.5).astype(np.uint8)


def write_ball_scene(folder: Path, size: int = 48, train: int = 24, test: int = 4) -> Path:
    """A NeRF-synthetic scene of one ball."""
    angle = 0.7
    focal = 0.5 * size / math.tan(0.5 * angle)
    for split, count in (("train", train), ("val", 2), ("test", test)):
        frames = []
        (folder / split).mkdir(parents=True)
        for i in range(count):
            pose = look_at_origin(2.399963 * i + (split == "test"), 0.15 + 1.1 * (i + 0.5) / count, 4.0)
            Image.fromarray(ball_picture(pose, size, focal)).save(folder / split / f"r_{i}.png")
            frames.append({"file_path": f"./{split}/r_{i}", "transform_matrix": pose.tolist()})
        text = json.dumps({"camera_angle_x": angle, "frames": frames})
        (folder / f"transforms_{split}.json").write_text(text)
    return folder


@pytest.fixture(scope="session")
def ball_scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_ball_scene(tmp_path_factory.mktemp("scenes") / "ball")


@pytest.fixture(scope="session")
def ball_field(ball_scene: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    field = tmp_path_factory.mktemp("fields") / "ball.safetensors"
    result = run_program("train", ball_scene, "-o", field, "--iterations", 150, "--seed", 1, "--quiet")
    assert result.returncode == 0, result.stderr
    return field
