"""The main job, once, with nothing but what is in the repository: train, edit from text, bake, render in Cycles.

    ./dev demo [--work DIR] [--result PNG] [--train-minutes M] [--edit-minutes M] [--blender PROGRAM]

Writes demo/result.png: a row a view; original, edit, edit map (red: added, green: changed, blue: removed), Cycles.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from sheets import edit_map, picture, sheet

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
VIEWS = 3


def run(step: str, command: list[str | Path]) -> float:
    """Runs one step, its progress on this terminal; ends the demo with the step's exit code when it fails."""
    print(f"\n== {step}", file=sys.stderr, flush=True)
    start = time.monotonic()
    code = subprocess.run([str(c) for c in command]).returncode
    if code != 0:
        sys.exit(f"demo: '{step}' ended with exit code {code}")
    return time.monotonic() - start


def test_views(scene: Path, count: int) -> list[str]:
    frames = json.loads((scene / "transforms_test.json").read_text())["frames"]
    return [Path(f["file_path"]).stem for f in frames[:: max(1, len(frames) // count)]][:count]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", type=Path, required=True)
    parser.add_argument("--work", type=Path, default=HERE / "work")
    parser.add_argument("--result", type=Path, default=HERE / "result.png")
    parser.add_argument("--blender", default="blender")
    parser.add_argument("--train-minutes", type=float, default=2.0)
    parser.add_argument("--edit-minutes", type=float, default=3.0)
    parser.add_argument("--resolution", type=int, default=192)
    prompts = json.loads((HERE / "prompts.json").read_text())
    args = parser.parse_args()

    scene, work = HERE / "scene", args.work
    work.mkdir(parents=True, exist_ok=True)
    field, edit, grid = work / "field.safetensors", work / "edit.safetensors", work / "edit.vdb"
    views = test_views(scene, VIEWS)
    select = ["--scene", scene, "--split", "test", "--views", ",".join(views)]
    seconds = {
        "train": run(
            "train a field on the demo scene",
            [args.program, "train", scene, "-o", field, "--minutes", args.train_minutes],
        ),
        "edit": run(
            f'edit: "{prompts["source"]}" becomes "{prompts["target"]}"',
            [
                args.program,
                "edit",
                field,
                "-o",
                edit,
                "--source",
                prompts["source"],
                "--target",
                prompts["target"],
                "--ops",
                prompts["ops"],
                "--scene",
                scene,
                "--minutes",
                args.edit_minutes,
            ],
        ),
        "render": run("render the original", [args.program, "render", field, *select, "-o", work / "original"])
        + run(
            "render the edit and its maps",
            [args.program, "render", field, edit, *select, "-o", work / "edited", "--maps"],
        ),
        "bake": run(
            "bake the edited field to OpenVDB",
            [args.program, "bake", field, edit, "-o", grid, "--resolution", args.resolution],
        ),
        "cycles": run(
            "render the volume in Cycles",
            [
                args.blender,
                "-b",
                "--factory-startup",
                "--python-exit-code",
                "1",
                "--python",
                ROOT / "blender_addon" / "render_volume.py",
                "--",
                "--vdb",
                grid,
                "--cameras",
                scene / "transforms_test.json",
                "--views",
                ",".join(views),
                "--out",
                work / "cycles",
                "--background",
                "white",
            ],
        ),
    }
    size = 256
    rows = [
        [
            picture(work / "original" / f"{v}.png", size),
            picture(work / "edited" / f"{v}.png", size),
            edit_map(work / "edited", v, size),
            picture(work / "cycles" / f"{v}.png", size),
        ]
        for v in views
    ]
    titles = [
        "original",
        f"edit: {prompts['target']}",
        "edit map: added changed removed (r g b)",
        "Cycles, from the .vdb",
    ]
    part = args.result.with_suffix(".part.png")
    sheet(rows, titles, size).save(part)
    os.replace(part, args.result)
    change = [float(np.abs(np.asarray(r[0], np.float32) - np.asarray(r[1], np.float32)).mean() / 255) for r in rows]
    print(
        json.dumps(
            {
                "result": str(args.result),
                "seconds": {k: round(v, 1) for k, v in seconds.items()},
                "mean_change": [round(c, 4) for c in change],
            }
        )
    )


if __name__ == "__main__":
    main()
