"""What accuracy costs in time on a scene: runs `fieldgraft profile` over all four sweeps and writes the page.

    ./dev accuracy --scene DIR --field FIELD.safetensors --edit EDIT.safetensors [--minutes M] [--page-only]

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
from pathlib import Path
from typing import Any

import results_page
from run import commit, gemm_gflops

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "docs" / "results"
CHARTS = ("training_psnr", "rendering_psnr", "editing_mp_clip", "editing_d_l1_outside", "baking_psnr", "baking_mib")


def profile(args: argparse.Namespace, name: str, *command: Any) -> dict[str, Any]:
    folder = args.work / name
    if not args.page_only:
        resume = ["--resume"] if (folder / "points.json").exists() else []
        full = [args.program, "profile", *command, "-o", folder, *resume]
        if subprocess.run([str(c) for c in full]).returncode != 0:
            sys.exit(f"accuracy: the profile of {name} ended early; the same command goes on with it")
    return json.loads((folder / "profile.json").read_text(encoding="utf-8"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", type=Path, required=True)
    parser.add_argument("--scene", type=Path, required=True)
    parser.add_argument("--field", type=Path, required=True, help="a trained field of the scene")
    parser.add_argument("--edit", type=Path, required=True, help="an edit of that field")
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "accuracy")
    parser.add_argument("--minutes", type=float, default=0.5, help="of training in its usual setting")
    parser.add_argument("--page-only", action="store_true", help="only write the page from the work folder")
    args = parser.parse_args()
    profiles = [
        profile(args, "field", args.field, "--scene", args.scene, "--sweeps", "rendering,baking"),
        profile(args, "edit", args.field, args.edit, "--scene", args.scene, "--sweeps", "editing"),
        profile(args, "scene", args.scene, "--minutes", args.minutes),
    ]
    report = {
        "commit": commit(),
        "processor": results_page.processor(),
        "gemm_float32": gemm_gflops(os.cpu_count() or 1),
        "points": [point for p in profiles for point in p["points"]],
        "fronts": {sweep: front for p in profiles for sweep, front in p["fronts"].items()},
    }
    part = OUT / "accuracy.json.part"
    part.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    os.replace(part, OUT / "accuracy.json")
    for chart in CHARTS:
        for found in args.work.glob(f"*/{chart}.svg"):
            shutil.copyfile(found, OUT / f"accuracy_{chart}.svg")
        for found in args.work.glob(f"*/{chart}.png"):
            shutil.copyfile(found, OUT / f"accuracy_{chart}.png")
    results_page.main()


if __name__ == "__main__":
    main()
