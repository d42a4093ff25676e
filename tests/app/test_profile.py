"""`fieldgraft profile`: tables and charts, going on after Ctrl-C, one-line errors."""

from __future__ import annotations

import csv
import json
import signal
import subprocess
import time
from pathlib import Path

import pytest
from conftest import PROGRAM, events_of, run_program


def points_of(folder: Path) -> dict[tuple[str, str], dict]:
    points = json.loads((folder / "profile.json").read_text())["points"]
    return {(p["knob"], p["value"]): p for p in points}


def test_rendering_and_baking_cost_what_they_give(ball_field: Path, tmp_path: Path) -> None:
    out = tmp_path / "profile"
    knobs = ["--knobs", "step,ends,picture,voxels", "--views", 2, "--repeats", 1, "--resolution", 32]
    result = run_program("profile", ball_field, "-o", out, *knobs, "--json")
    events = events_of(result)
    assert result.returncode == 0, result.stderr
    points = points_of(out)
    assert events[-1]["event"] == "done" and events[-1]["points"] == len(points)
    assert sum(e["event"] == "progress" for e in events) == len(points)

    def psnr(knob: str, value: str) -> float:
        return points[knob, value]["figures"]["psnr"]

    # Finer steps come nearer to the converged picture, smaller pictures less near, more voxels nearer to the field.
    steps = [psnr("step, of the diagonal", f"1/{n}") for n in (128, 512, 2048)]
    assert steps == sorted(steps) and steps[-1] > steps[0] + 10
    assert psnr("picture scale", "0.25") < psnr("picture scale", "0.75") < psnr("step, of the diagonal", "1/1024")
    assert psnr("ends at transmittance", "0.3") < psnr("ends at transmittance", "0.001")
    voxels = [psnr("voxels an edge", str(n)) for n in (8, 16, 32)]
    assert voxels == sorted(voxels) and voxels[-1] > 20
    rows = list(csv.DictReader((out / "points.csv").open()))
    assert len(rows) == len(points) and {r["sweep"] for r in rows} == {"rendering", "baking"}
    assert sum(r["usual"] == "1" for r in rows) == 2
    for chart in ("rendering_psnr", "baking_psnr", "baking_mib"):
        assert (out / f"{chart}.svg").stat().st_size > 1000 and (out / f"{chart}.png").stat().st_size > 1000
    assert not list(out.glob("*.vdb"))  # grids of the trials are gone


def test_stopped_and_gone_on_with(ball_field: Path, tmp_path: Path) -> None:
    out = tmp_path / "profile"
    arguments = ["profile", ball_field, "-o", out, "--sweeps", "rendering", "--views", 2, "--json"]
    with subprocess.Popen([PROGRAM, *map(str, arguments)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and "progress" in process.stdout.readline()
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=60) == 130
    saved = json.loads((out / "points.json").read_text())["points"]
    assert 1 <= len(saved) < 15
    again = run_program(*arguments)
    assert again.returncode == 2 and "--resume" in again.stderr
    other = run_program(*arguments[:-3], "--views", 3, "--resume")
    assert other.returncode == 2 and "another folder" in other.stderr
    start = time.monotonic()
    assert run_program(*arguments, "--resume", "--knobs", "step").returncode == 0
    assert time.monotonic() - start < 120
    points = points_of(out)
    for point in saved:  # not measured again
        kept = points.get((point["knob"], point["value"]))
        assert kept is None or kept["repeats"] == point["repeats"]


def test_editing_is_judged(ball_scene: Path, ball_field: Path, tmp_path: Path) -> None:
    edit = tmp_path / "red.safetensors"
    prompt = ["--source", "yellow ball", "--target", "red ball", "--ops", "change", "--patch", 48, "--iterations", 16]
    assert run_program("edit", ball_field, "-o", edit, *prompt, "--quiet").returncode == 0
    out = tmp_path / "profile"
    options = ["--scene", ball_scene, "--sweeps", "editing", "--knobs", "patch", "--views", 1]
    result = run_program("profile", ball_field, edit, "-o", out, *options)
    assert result.returncode == 0, result.stderr
    points = points_of(out)
    # A picture of 48 pixels has no larger patch.
    assert set(points) == {("iterations", "16"), ("patch, pixels an edge", "32")}
    for point in points.values():
        figures = point["figures"]
        assert {"seconds", "s_clip", "mp_clip", "d_l1_inside", "d_l1_outside"} <= figures.keys()
        assert figures["d_l1_outside"] < figures["d_l1_inside"] < 1


def test_training_is_measured_by_steps(ball_scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "profile"
    options = ["--minutes", 0.03, "--knobs", "network,minutes", "--views", 2]
    result = run_program("profile", ball_scene, "-o", out, *options)
    assert result.returncode == 0, result.stderr
    points = points_of(out)
    usual = points["minutes", "0.03"]["figures"]
    for width in (16, 64, 128):
        assert points["network width", str(width)]["figures"]["iterations"] == usual["iterations"]
    assert usual["iterations"] > 0 and usual["psnr"] > 5


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere", "-o", "x"], ["nowhere"]),
        (["missing.safetensors", "-o", "x"], ["missing.safetensors"]),
        (["FIELD", "-o", "x", "--sweeps", "editing"], ["editing", "EDIT"]),
        (["FIELD", "-o", "x", "--sweeps", "training"], ["training", "--scene"]),
        (["FIELD", "-o", "x", "--knobs", "colour"], ["colour", "voxels an edge"]),
        (["SCENE", "FIELD", "-o", "x"], ["FIELD.safetensors first"]),
    ],
)
def test_bad_usage_is_one_line(
    ball_scene: Path, ball_field: Path, tmp_path: Path, arguments: list[str], words: list[str]
) -> None:
    given = {"FIELD": ball_field, "SCENE": ball_scene, "x": tmp_path / "x"}
    result = run_program("profile", *[given.get(a, a) for a in arguments])
    assert result.returncode == 2, result.stderr
    lines = [line for line in result.stderr.splitlines() if line.startswith("fieldgraft:")]
    assert len(lines) == 1 and all(word in lines[0] for word in words), result.stderr
