"""What accuracy costs in time on a scene: runs `fieldgraft profile` over all four sweeps, and Cycles over a bake, and
writes the page.

    ./dev accuracy --scene DIR --field FIELD.safetensors --edit EDIT.safetensors [--minutes M] [--parts …] [--page-only]

Points that the work folder holds already are not measured again. Writes docs/results/accuracy.json, the charts beside
it and the tables of docs/accuracy-and-time.md.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import results
import results_page
from run import commit, done_event, gemm_gflops, write_report

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "docs" / "results"
CHARTS = ("training_psnr", "rendering_psnr", "editing_mp_clip", "editing_d_l1_outside", "baking_psnr", "baking_mib")


def profile(args: argparse.Namespace, name: str, *command: Any) -> dict[str, Any]:
    folder = args.work / name
    if name in args.parts:
        resume = ["--resume"] if (folder / "points.json").exists() else []
        full = [args.program, "profile", *command, "-o", folder, *resume]
        if subprocess.run([str(c) for c in full]).returncode != 0:
            sys.exit(f"accuracy: the profile of {name} ended early; the same command goes on with it")
    return json.loads((folder / "profile.json").read_text(encoding="utf-8"))


class CyclesSweep:
    """Cycles' pictures of a bake against the engine's own of the same field: step rate, voxels, samples a pixel."""

    USUAL = {"resolution": 256, "step_rate": 0.25, "samples": 1}
    TURNED = [
        *(("step rate, of a voxel", "step_rate", rate) for rate in (2, 1, 0.5, 0.1)),
        *(("voxels an edge", "resolution", n) for n in (64, 128, 384)),
        ("samples a pixel", "samples", 4),
    ]

    def __init__(self, args: argparse.Namespace) -> None:
        self.args, self.work = args, args.work / "cycles"
        self.views = ["--scene", args.scene, "--split", "test", "--views", ",".join(results.VIEWS)]

    def measure(self, resolution: int, step_rate: float, samples: int) -> dict[str, float]:
        grid = self.work / f"{resolution}.vdb"
        if not grid.exists():
            done_event([self.args.program, "bake", self.args.field, "-o", grid, "--resolution", resolution])
        own = self.work / "engine"
        if not own.exists():
            same = ["--compositing", "conserving", "--color", "diffuse"]
            done_event([self.args.program, "render", self.args.field, *self.views, "-o", own, *same])
        out = self.work / "pictures"
        start = time.perf_counter()
        options = ["--step-rate", step_rate, "--samples", samples]
        results.render_in_cycles(self.args.blender, grid, self.args.scene, out, options)
        seconds = (time.perf_counter() - start) / len(results.VIEWS)
        alike = [results.psnr(out / f"{v}.png", own / f"{v}.png") for v in results.VIEWS]
        return {"seconds": seconds, "psnr": sum(alike) / len(alike)}

    def run(self) -> list[dict[str, Any]]:
        file = self.work / "points.json"
        points = json.loads(file.read_text()) if file.exists() else []
        trials = [("step rate, of a voxel", "step_rate", self.USUAL["step_rate"]), *self.TURNED]
        for knob, key, value in trials:
            if "cycles" not in self.args.parts or any((p["knob"], p["value"]) == (knob, str(value)) for p in points):
                continue
            self.work.mkdir(parents=True, exist_ok=True)
            figures = self.measure(**(self.USUAL | {key: value}))
            point = {"sweep": "cycles", "knob": knob, "value": str(value), "usual": value == self.USUAL[key]}
            points.append(point | {"repeats": [figures["seconds"]], "figures": figures})
            file.write_text(json.dumps(points, indent=1))
        return points

    @staticmethod
    def front(points: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """From the fastest on, those that are better than all that are faster."""
        front: list[dict[str, Any]] = []
        for p in sorted(points, key=lambda p: p["figures"]["seconds"]):
            if not front or p["figures"]["psnr"] > front[-1]["psnr"]:
                front.append({"knob": p["knob"], "value": p["value"], **p["figures"]})
        return front


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", type=Path, required=True)
    parser.add_argument("--scene", type=Path, required=True)
    parser.add_argument("--field", type=Path, required=True, help="a trained field of the scene")
    parser.add_argument("--edit", type=Path, required=True, help="an edit of that field")
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "accuracy")
    parser.add_argument("--minutes", type=float, default=0.5, help="of training in its usual setting")
    parser.add_argument("--blender", default="blender")
    parser.add_argument("--parts", default="field,edit,scene,cycles", help="to measure; the others as they were left")
    parser.add_argument("--page-only", action="store_true", help="only write the page from the work folder")
    args = parser.parse_args()
    args.parts = [] if args.page_only else args.parts.split(",")
    profiles = [
        profile(args, "field", args.field, "--scene", args.scene, "--sweeps", "rendering,baking"),
        profile(args, "edit", args.field, args.edit, "--scene", args.scene, "--sweeps", "editing"),
        profile(args, "scene", args.scene, "--minutes", args.minutes),
    ]
    sweep = CyclesSweep(args)
    cycles = sweep.run()
    report = {
        "commit": commit(),
        "processor": results_page.processor(),
        "gemm_float32": gemm_gflops(os.cpu_count() or 1),
        "points": [point for p in profiles for point in p["points"]] + cycles,
        "fronts": {sweep: front for p in profiles for sweep, front in p["fronts"].items()}
        | {"cycles": {"psnr": sweep.front(cycles)}},
    }
    write_report(OUT / "accuracy.json", report)
    for chart in CHARTS:
        for found in args.work.glob(f"*/{chart}.svg"):
            shutil.copyfile(found, OUT / f"accuracy_{chart}.svg")
        for found in args.work.glob(f"*/{chart}.png"):
            shutil.copyfile(found, OUT / f"accuracy_{chart}.png")
    results_page.main()


if __name__ == "__main__":
    main()
