"""The program as a user runs it: figures, files, exit codes, one-line errors, cancel and resume."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import PROGRAM, ROOT, events_of, run_program, write_ball_scene
from PIL import Image


def assert_one_line_error(result: subprocess.CompletedProcess, *words: str) -> None:
    assert result.returncode == 2, (result.returncode, result.stderr)
    lines = [line for line in result.stderr.splitlines() if line.startswith("fieldgraft:")]
    assert len(lines) == 1, result.stderr
    for word in words:
        assert word in lines[0], lines[0]


def test_train_reports_figures_and_reaches_the_scene(ball_scene: Path, ball_field: Path) -> None:
    done = events_of(run_program("eval", ball_field, "--scene", ball_scene, "--split", "test", "--json"))[-1]
    assert done["event"] == "done"
    assert done["psnr"] > 20  # 22.2 measured; a grey picture has 9
    assert done["ssim"] > 0.7


@pytest.mark.parametrize(("given", "expected"), [({}, "2000"), ({"GOMP_SPINCOUNT": "7"}, "7")])
def test_threads_wait_busily_for_a_moment_only(
    ball_scene: Path, tmp_path: Path, given: dict[str, str], expected: str
) -> None:
    clean = {k: v for k, v in os.environ.items() if k not in ("GOMP_SPINCOUNT", "OMP_WAIT_POLICY")}
    command = [PROGRAM, "train", ball_scene, "-o", tmp_path / "f.safetensors", "--iterations", "100000", "--json"]
    with subprocess.Popen(command, env=clean | given, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None and process.stdout.readline()  # it runs
            environment = Path(f"/proc/{process.pid}/environ").read_bytes().split(b"\0")
            assert f"GOMP_SPINCOUNT={expected}".encode() in environment
        finally:
            process.kill()


def test_train_events_follow_the_contract(ball_scene: Path, tmp_path: Path) -> None:
    field = tmp_path / "f.safetensors"
    events = events_of(run_program("train", ball_scene, "-o", field, "--iterations", 40, "--json"))
    progress = [e for e in events if e["event"] == "progress"]
    assert progress and {"iteration", "total", "loss", "eta_s"} <= progress[-1].keys()
    assert {"iterations", "samples", "seconds", "peak_mib"} <= events[-1].keys()
    assert events[-1]["event"] == "done" and events[-1]["iterations"] == 40
    assert field.exists() and not list(tmp_path.glob("*.part*"))


def test_same_seed_one_thread_same_bytes(ball_scene: Path, tmp_path: Path) -> None:
    files = []
    for name in ("a", "b"):
        files.append(tmp_path / f"{name}.safetensors")
        arguments = ["--iterations", 12, "--seed", 7, "--threads", 1, "--quiet"]
        assert run_program("train", ball_scene, "-o", files[-1], *arguments).returncode == 0
    assert files[0].read_bytes() == files[1].read_bytes()


def test_pictures_without_alpha_before_one_colour(ball_scene: Path, tmp_path: Path) -> None:
    """As a studio's camera takes them, in nerfstudio's form, where the program puts the cameras inside the box."""
    scene = tmp_path / "studio"
    (scene / "images").mkdir(parents=True)
    given = json.loads((ball_scene / "transforms_train.json").read_text())
    frames = []
    for frame in given["frames"]:
        picture = Image.open((ball_scene / frame["file_path"]).with_suffix(".png"))
        name = f"images/{Path(frame['file_path']).name}.png"
        grey = Image.new("RGBA", picture.size, (120, 140, 150, 255))
        grey.alpha_composite(picture)
        grey.convert("RGB").save(scene / name)
        frames.append({"file_path": name, "transform_matrix": frame["transform_matrix"]})
    width, height = picture.size
    focal = 0.5 * width / math.tan(0.5 * given["camera_angle_x"])
    camera = {"w": width, "h": height, "fl_x": focal, "fl_y": focal, "cx": width / 2, "cy": height / 2}
    (scene / "transforms.json").write_text(json.dumps(camera | {"frames": frames}))
    field = tmp_path / "field.safetensors"
    result = run_program("train", scene, "-o", field, "--iterations", 300, "--json")
    assert result.returncode == 0, result.stderr
    events = events_of(result)
    assert any("#788c96" in event.get("message", "") for event in events)
    assert events[-1]["psnr"] > 22
    assert run_program("bake", field, "-o", tmp_path / "b.vdb", "--resolution", 32).returncode == 0
    done = events_of(run_program("eval", field, "--scene", scene, "--split", "train", "--json"))[-1]
    assert done["psnr"] > 22


def test_render_writes_png_and_exr_named_after_the_view(ball_scene: Path, ball_field: Path, tmp_path: Path) -> None:
    out = tmp_path / "views"
    result = run_program("render", ball_field, "--scene", ball_scene, "--split", "test", "-o", out, "--quiet")
    assert result.returncode == 0, result.stderr
    assert sorted(p.name for p in out.glob("*.png")) == [f"r_{i}.png" for i in range(4)]
    assert sorted(p.name for p in out.glob("*.exr")) == [f"r_{i}.exr" for i in range(4)]
    rendered = np.asarray(Image.open(out / "r_1.png").convert("RGB"), np.float32)
    truth = Image.open(ball_scene / "test" / "r_1.png")
    white = Image.new("RGBA", truth.size, (255, 255, 255, 255))
    expected = np.asarray(Image.alpha_composite(white, truth).convert("RGB"), np.float32)
    assert np.abs(rendered - expected).mean() < 12


def test_coarser_pictures_and_bakes_for_less(ball_scene: Path, ball_field: Path, tmp_path: Path) -> None:
    pictures = []
    for quality in ("draft", "final"):
        out = tmp_path / quality
        views = ["--scene", ball_scene, "--split", "test", "--views", "r_1"]
        assert run_program("render", ball_field, *views, "-o", out, "--quality", quality, "--quiet").returncode == 0
        pictures.append(np.asarray(Image.open(out / "r_1.png").convert("RGB"), np.float32))
    difference = np.abs(pictures[0] - pictures[1]).mean()
    assert 0 < difference < 3
    voxels = []
    for quality in ("draft", "preview"):
        bake = ["bake", ball_field, "-o", tmp_path / f"{quality}.vdb", "--quality", quality, "--json"]
        voxels.append(events_of(run_program(*bake))[-1]["voxels"])
    assert 4 * voxels[0] < voxels[1] < 16 * voxels[0]
    both = run_program("bake", ball_field, "-o", tmp_path / "x.vdb", "--quality", "draft", "--resolution", 64)
    assert_one_line_error(both, "--quality", "--resolution")


def test_bake_writes_a_grid_and_its_figures(ball_field: Path, tmp_path: Path) -> None:
    grid = tmp_path / "ball.vdb"
    done = events_of(run_program("bake", ball_field, "-o", grid, "--resolution", 48, "--json"))[-1]
    assert done["voxels"] > 500 and done["bytes"] == grid.stat().st_size and done["seconds"] > 0


def test_info_names_what_a_file_is(ball_field: Path) -> None:
    info = json.loads(run_program("info", ball_field, "--json").stdout.splitlines()[-1])
    assert info["files"][0]["kind"] == "field" and len(info["files"][0]["hash"]) == 64


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["train", "nowhere", "-o", "f.safetensors"], ["nowhere"]),
        (["train"], ["required"]),
        (["trian"], []),
        (["train", "x", "-o", "y", "--minutes", "-3"], ["minutes"]),
        (["info", "missing.safetensors"], ["missing.safetensors"]),
        (["render", "missing.safetensors", "--scene", "x", "-o", "y"], ["missing.safetensors"]),
        (["eval", "missing.safetensors", "--scene", "x"], ["missing.safetensors"]),
        (["bake", "missing.safetensors", "-o", "x.vdb"], ["missing.safetensors"]),
    ],
)
def test_bad_usage_is_one_line_and_exit_code_2(arguments: list[str], words: list[str]) -> None:
    assert_one_line_error(run_program(*arguments), *words)


def test_a_truncated_field_is_named(ball_field: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken.safetensors"
    broken.write_bytes(ball_field.read_bytes()[:5000])
    assert_one_line_error(run_program("info", broken), "broken.safetensors")


def test_a_truncated_picture_is_named(tmp_path: Path) -> None:
    scene = write_ball_scene(tmp_path / "scene", size=32, train=3, test=1)
    picture = scene / "train" / "r_1.png"
    picture.write_bytes(picture.read_bytes()[:200])
    result = run_program("train", scene, "-o", tmp_path / "f.safetensors", "--iterations", 5)
    assert_one_line_error(result, "r_1.png")
    assert not (tmp_path / "f.safetensors").exists()


def test_an_edit_refuses_equal_prompts_and_no_operation(ball_field: Path, tmp_path: Path) -> None:
    same = ["--source", "ball", "--target", "ball", "--ops", "change"]
    assert_one_line_error(run_program("edit", ball_field, "-o", tmp_path / "e.safetensors", *same), "ball")
    unknown = ["--source", "ball", "--target", "red ball", "--ops", "paint"]
    assert_one_line_error(run_program("edit", ball_field, "-o", tmp_path / "e.safetensors", *unknown), "paint")


def test_interrupted_training_saves_and_resumes(ball_scene: Path, tmp_path: Path) -> None:
    field = tmp_path / "f.safetensors"
    command = [PROGRAM, "train", ball_scene, "-o", field, "--iterations", "120", "--json"]
    process = subprocess.Popen([str(c) for c in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    for line in process.stdout:
        if json.loads(line).get("iteration", 0) >= 20:
            break
    process.send_signal(signal.SIGINT)
    start = time.monotonic()
    process.communicate(timeout=60)
    assert process.returncode == 130
    assert time.monotonic() - start < 20
    resumed = run_program("train", ball_scene, "-o", field, "--iterations", 120, "--resume", "--json")
    events = events_of(resumed)
    assert events[0].get("iteration", 99) >= 20
    assert field.exists()


def test_the_built_in_guide_edits_the_ball(ball_scene: Path, ball_field: Path, tmp_path: Path) -> None:
    """Few iterations: that an edit runs, is saved, changes the picture, and is bit-exact where its strength is 0."""
    if not (ROOT / "models" / "guide" / "model.safetensors").exists():
        pytest.skip("the built-in guidance model is not in this checkout")
    edit = tmp_path / "e.safetensors"
    prompts = ["--source", "ball", "--target", "blue ball", "--ops", "change", "--patch", 48]
    scene = ["--scene", ball_scene]
    done = events_of(run_program("edit", ball_field, "-o", edit, *prompts, *scene, "--iterations", 30, "--json"))[-1]
    assert {"iterations", "seconds", "seconds_per_iteration", "field_seconds_per_iteration"} <= done.keys()
    views = ["--scene", ball_scene, "--split", "test", "--quiet"]
    for name, edits in (("plain", []), ("off", [f"{edit}:change=0"]), ("on", [edit])):
        result = run_program("render", ball_field, *edits, *views, "-o", tmp_path / name)
        assert result.returncode == 0, result.stderr
    plain, off, on = ((tmp_path / n / "r_0.exr").read_bytes() for n in ("plain", "off", "on"))
    assert plain == off
    assert plain != on


@pytest.mark.parametrize("operations", ["change", "remove"])
def test_info_of_an_edit_shows_its_plan(ball_scene: Path, ball_field: Path, tmp_path: Path, operations: str) -> None:
    edit = tmp_path / "e.safetensors"
    prompt = ["--source", "yellow ball", "--target", "blue ball", "--ops", operations]
    size = ["--patch", 16, "--augmentations", 2, "--iterations", 2]
    events_of(run_program("edit", ball_field, "-o", edit, "--scene", ball_scene, *prompt, *size, "--json"))
    info = events_of(run_program("info", edit, "--json"))[-1]["files"][0]
    plan = info["plan"]
    assert plan["heads"] == {"change": ["color_e", "beta_color"], "remove": ["beta_density"]}[operations]
    assert plan["cost"]["parameters"] > 0 and 0 <= info["support_share"] <= 1
    reasons = {item["what"]: item["why"] for item in plan["left_out"]}
    assert any("nothing is added" in why for why in reasons.values())
    assert any("colour of g, its picture" in what for what in reasons) == (operations == "remove")
    for_people = run_program("info", edit)
    assert for_people.returncode == 0 and "what is left out" in for_people.stdout


def test_an_edit_without_a_good_step_ends_with_exit_code_1(ball_scene: Path, ball_field: Path, tmp_path: Path) -> None:
    """Every loss is infinite: steps are left out, the last good state comes back eight times, then it stops."""
    if not (ROOT / "models" / "guide" / "model.safetensors").exists():
        pytest.skip("the built-in guidance model is not in this checkout")
    prompts = ["--source", "ball", "--target", "blue ball", "--ops", "change", "--weight", "dir=1e300"]
    cheap = ["--patch", 24, "--augmentations", 1, "--iterations", 200, "--scene", ball_scene]
    result = run_program("edit", ball_field, "-o", tmp_path / "e.safetensors", *prompts, *cheap, "--json")
    assert result.returncode == 1, result.stderr
    events = [json.loads(line) for line in result.stdout.splitlines()]
    assert len([e for e in events if e["event"] == "warning" and "learning rate" in e["message"]]) == 8
    error = [e for e in events if e["event"] == "error"][-1]
    assert "e.checkpoint.safetensors" in error["message"] and "\n" not in error["message"]
    assert error["kind"] == "failure"
    assert max(e.get("skipped", 0) for e in events) >= 8
    assert (tmp_path / "e.checkpoint.safetensors").exists()
    assert not (tmp_path / "e.safetensors").exists()
