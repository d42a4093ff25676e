"""What is told beforehand: the machine measured once, what pictures and bakes take, how long a PSNR takes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from conftest import events_of, run_program


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "fieldgraft" / "machine.json"


def test_a_measured_machine_is_told_of(cache: Path, ball_field: Path, ball_scene: Path, tmp_path: Path) -> None:
    before = events_of(run_program("info", ball_field, "--json"))[-1]["files"][0]
    assert "seconds" not in before  # nothing is known of this machine yet
    done = events_of(run_program("profile", "--calibrate", "--json"))[-1]
    assert done["path"] == str(cache) and done["speed"] > 0
    machine = json.loads(cache.read_text())
    assert all(machine[kind]["base"] >= 0 for kind in ("fit", "draw", "voxel")) and machine["ray"] > 0
    told = events_of(run_program("info", ball_field, "--json"))[-1]["files"][0]["seconds"]
    assert 0 < told["view"] < 60
    assert 0 < told["bake_128"] < told["bake_256"] < told["bake_384"]
    # As many iterations on as many samples: twice as many take twice as long.
    minutes = []
    for iterations in (3, 6):
        flags = ["--iterations", iterations, "--samples", 1024, "--json"]
        events = events_of(run_program("train", ball_scene, "-o", tmp_path / "f.safetensors", *flags))
        minutes.append(next(e for e in events if e["event"] == "forecast")["minutes"])
    assert minutes[1] == pytest.approx(2 * minutes[0])


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (["--error", "sharp"], ["--error sharp", "30dB"]),
        (["--error", "30dB", "--minutes", "1"], ["--error", "--minutes"]),
        (["--error", "30dB", "--quality", "draft"], ["--error", "--quality"]),
    ],
)
def test_bad_errors_are_one_line(ball_scene: Path, tmp_path: Path, flags: list[str], words: list[str]) -> None:
    result = run_program("train", ball_scene, "-o", tmp_path / "f.safetensors", *flags)
    assert result.returncode == 2 and len(result.stderr.strip().splitlines()) == 1
    assert all(word in result.stderr for word in words)


def test_a_psnr_is_trained_for_as_long_as_it_takes(ball_scene: Path, tmp_path: Path) -> None:
    field = tmp_path / "f.safetensors"
    events = events_of(run_program("train", ball_scene, "-o", field, "--error", "12dB", "--json"))
    told = next(e for e in events if e["event"] == "forecast")
    assert told["minutes"] == pytest.approx(16 / 60)  # the probe alone reaches that
    assert events[-1]["psnr"] > 12 and field.exists()


def test_what_cannot_be_reached_is_said(ball_scene: Path, tmp_path: Path) -> None:
    result = run_program("train", ball_scene, "-o", tmp_path / "f.safetensors", "--error", "90dB")
    assert result.returncode == 2 and "ask for less" in result.stderr.splitlines()[-1]
    assert not (tmp_path / "f.safetensors").exists()


def test_what_a_forecast_takes(ball_field: Path) -> None:
    for arguments in (["profile", "--forecast"], ["profile", ball_field, "--forecast"], ["profile"]):
        result = run_program(*arguments)
        assert result.returncode == 2 and "SCENE" in result.stderr
