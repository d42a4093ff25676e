"""Does the cost model keep its word? What it tells beside what comes of it, scene by scene.

    ./dev forecast --scenes DIR DIR … [--minutes 1 2] [--parts times errors] [--page-only]

Measures the machine (`profile --calibrate`), then for every scene: the PSNR that `train --error` expects after those
minutes and the test views' once they have passed; seconds of so many iterations, of a picture, of a bake. Scenes that
nothing was chosen by: bench/scenes/make_scenes.py. Writes docs/results/forecast.json and its table in
docs/accuracy-and-time.md.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import results_page
from run import commit, done_event, write_report

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "accuracy-and-time.md"
FIGURES = ROOT / "docs" / "results" / "forecast.json"
ITERATIONS = 1500


def events(command: list[Any]) -> list[dict[str, Any]]:
    result = subprocess.run([*map(str, command), "--json"], stdout=subprocess.PIPE, text=True)
    if result.returncode != 0:
        sys.exit(f"forecast: {' '.join(map(str, command))} ended with exit code {result.returncode}")
    return [json.loads(line) for line in result.stdout.splitlines() if line.startswith("{")]


def told(scene_events: list[dict[str, Any]]) -> dict[str, Any]:
    return next(e for e in scene_events if e["event"] == "forecast")


class Check:
    def __init__(self, program: Path, scene: Path, folder: Path) -> None:
        self.program, self.scene, self.field = program, scene, folder / "f.safetensors"
        self.rows: list[dict[str, Any]] = []

    def note(self, what: str, told: float, came: float, unit: str) -> None:
        row = {"scene": self.scene.name, "what": what, "told": round(told, 3), "came": round(came, 3), "unit": unit}
        self.rows.append(row)
        print(json.dumps(row), flush=True)

    def errors(self, minutes: list[float]) -> None:
        """What a probe says of several times, and what those times bring."""
        probe = events([self.program, "profile", self.scene, "--forecast"])[-1]
        expected = {point["minutes"]: point["psnr"] for point in probe["forecast"]}
        for m in minutes:
            done_event([self.program, "train", self.scene, "-o", self.field, "--minutes", m])
            found = done_event([self.program, "eval", self.field, "--scene", self.scene, "--split", "test"])
            self.note(f"test PSNR after {m:g} min", expected[m], found["psnr"], "dB")

    def times(self) -> None:
        train = events([self.program, "train", self.scene, "-o", self.field, "--iterations", ITERATIONS])
        self.note(f"{ITERATIONS:,} iterations", 60 * told(train)["minutes"], train[-1]["seconds"], "s")
        expected = events([self.program, "info", self.field])[-1]["files"][0]["seconds"]
        views = done_event([self.program, "eval", self.field, "--scene", self.scene, "--split", "test"])
        self.note("a test view", expected["view"], views["seconds_per_view"], "s")
        for resolution in (128, 256):
            grid = ["-o", self.field.with_suffix(".vdb"), "--resolution", resolution]
            baked = done_event([self.program, "bake", self.field, *grid])
            self.note(f"a bake of {resolution}", expected[f"bake_{resolution}"], baked["seconds"], "s")


def off(row: dict[str, Any]) -> str:
    if row["unit"] == "dB":
        return f"{row['told'] - row['came']:+.1f} dB"
    return f"{100 * (row['told'] / row['came'] - 1):+.0f} %"


def write_page(report: dict[str, Any]) -> None:
    digits = {"dB": 1, "s": 2}
    rows = [
        [
            row["scene"],
            row["what"],
            f"{row['told']:.{digits[row['unit']]}f} {row['unit']}",
            f"{row['came']:.{digits[row['unit']]}f} {row['unit']}",
            off(row),
        ]
        for row in report["rows"]
    ]
    table = results_page.table(["scene", "what", "told", "came", "off by"], rows)
    page = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(results_page.fill(page, {"forecast": table}), encoding="utf-8")


def measure(args: argparse.Namespace) -> dict[str, Any]:
    rows = []
    with tempfile.TemporaryDirectory() as cache:
        os.environ["XDG_CACHE_HOME"] = cache
        machine = done_event([args.program, "profile", "--calibrate"])
        print(json.dumps(machine), flush=True)
        for scene in args.scenes:
            check = Check(args.program, scene, Path(cache))
            if "times" in args.parts:
                check.times()
            if "errors" in args.parts:
                check.errors(args.minutes)
            rows += check.rows
    about = {"commit": commit(), "machine": machine["machine"], "calibration_seconds": machine["seconds"]}
    return {**about, "rows": joined(rows)}


def joined(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """With the rows of parts that were not measured again, scene by scene."""
    old = json.loads(FIGURES.read_text())["rows"] if FIGURES.exists() else []
    new = {(row["scene"], row["what"]): row for row in rows}
    scenes = dict.fromkeys(row["scene"] for row in rows)
    kept = [row for row in old if row["scene"] in scenes and (row["scene"], row["what"]) not in new]
    return [row for scene in scenes for row in rows + kept if row["scene"] == scene]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", type=Path, required=True)
    parser.add_argument("--scenes", type=Path, nargs="+", default=[])
    parser.add_argument("--minutes", type=float, nargs="+", default=[1.0, 2.0], help="of .5, 1, 2, 3, 5, 10, 30")
    parser.add_argument("--parts", nargs="+", choices=("times", "errors"), default=["times", "errors"])
    parser.add_argument("--page-only", action="store_true", help="write the page again from forecast.json")
    args = parser.parse_args()
    if not args.page_only:
        write_report(FIGURES, measure(args))
    write_page(json.loads(FIGURES.read_text()))


if __name__ == "__main__":
    main()
