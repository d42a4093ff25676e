"""What docs/results.md shows: a field's accuracy over time, edits from text alone, and the bake, on the lego scene.

    ./dev results --scene DIR [--out docs/results] [--work DIR] [--only field,edits,bake] [--minutes 1 2 5 10]

Writes OUT/lego.json and OUT/lego_*.png, and the tables of docs/results.md. A field that WORK holds already is not
trained again. The regions that edits are judged by are drawn by hand (bench/lego/regions.json); the edits never see
them.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import results_page
from PIL import Image, ImageDraw
from run import commit, done_event, measure

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path.insert(0, str(ROOT / "demo"))

from sheets import edit_map, picture, sheet  # noqa: E402

VIEWS = ["r_176", "r_0", "r_152"]
TILE = 256


def draw_mask(regions: dict[str, Any], name: str, size: tuple[int, int], path: Path) -> str:
    """The hand-drawn region as a picture, white inside; returns VIEW:FILE."""
    region = regions[name]
    mask = Image.new("L", size, 0)
    draw = ImageDraw.Draw(mask)
    draw.polygon([tuple(p) for p in region["outline"]], fill=255)
    for other in region.get("without", []):
        draw.polygon([tuple(p) for p in regions[other]["outline"]], fill=0)
    mask.save(path)
    return f"{region['view']}:{path}"


def pixels(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB"), np.float32) / 255


def hue_and_strength(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Hue in degrees, and saturation times value."""
    top, low = image.max(-1), image.min(-1)
    span = np.maximum(top - low, 1e-6)
    r, g, b = image[..., 0], image[..., 1], image[..., 2]
    hue = np.where(top == r, (g - b) / span % 6, np.where(top == g, (b - r) / span + 2, (r - g) / span + 4)) * 60
    return hue, top - low


def within(hue: np.ndarray, low: float, high: float) -> np.ndarray:
    return (hue >= low) & (hue <= high) if low <= high else (hue >= low) | (hue <= high)


def turned_share(before: Path, after: Path, views: list[str], hues: dict[str, list[float]]) -> float:
    """Of the pixels with a hue `from` (and some saturation) before: the share with a hue `to` after."""
    turned = there = 0
    for view in views:
        hue, strength = hue_and_strength(pixels(before / f"{view}.png"))
        was = within(hue, *hues["from"]) & (strength > 0.3)
        hue, strength = hue_and_strength(pixels(after / f"{view}.png"))
        turned += int((was & within(hue, *hues["to"]) & (strength > 0.2)).sum())
        there += int(was.sum())
    return turned / max(1, there)


def psnr(a: Path, b: Path) -> float:
    return float(-10 * np.log10(np.mean((pixels(a) - pixels(b)) ** 2)))


class Results:
    def __init__(self, args: argparse.Namespace) -> None:
        self.args = args
        self.program, self.scene, self.work, self.out = args.program, args.scene, args.work, args.out
        self.work.mkdir(parents=True, exist_ok=True)
        self.out.mkdir(parents=True, exist_ok=True)
        self.field = self.work / "field.safetensors"
        self.file = self.out / "lego.json"
        self.report: dict[str, Any] = json.loads(self.file.read_text()) if self.file.exists() else {}
        self.views = ["--scene", self.scene, "--split", "test", "--views", ",".join(VIEWS)]

    def save(self) -> None:
        self.report["commit"] = commit()
        part = self.file.with_suffix(".part")
        part.write_text(json.dumps(self.report, indent=1) + "\n")
        os.replace(part, self.file)

    def run(self, *command: Any) -> dict[str, Any]:
        return done_event([self.program, *command])

    def fields(self) -> None:
        """Accuracy after each budget; the longest one's field is kept for the edits."""
        rows = {row["minutes"]: row for row in self.report.get("field", [])}
        for minutes in sorted(self.args.minutes):
            rows[minutes] = measure(self.program, self.scene, minutes, self.args.threads, self.work)
            print(json.dumps(rows[minutes]), file=sys.stderr, flush=True)
            self.report["field"] = [rows[m] for m in sorted(rows)]
            self.save()
        longest = max(self.args.minutes)
        if longest == max(rows):
            os.replace(self.work / f"field_{longest:g}.safetensors", self.field)

    def original(self) -> Path:
        folder = self.work / "original"
        if not folder.exists() or folder.stat().st_mtime < self.field.stat().st_mtime:
            self.run("render", self.field, *self.views, "-o", folder)
        return folder

    def edits(self) -> None:
        regions = json.loads((HERE / "lego" / "regions.json").read_text())
        original = self.original()
        size = Image.open(original / f"{VIEWS[0]}.png").size
        wanted = self.args.edits.split(",") if self.args.edits else None
        for spec in json.loads((HERE / "lego" / "edits.json").read_text()):
            name = spec["name"]
            if wanted and name not in wanted:
                continue
            edit, folder = self.work / f"{name}.safetensors", self.work / name
            prompt = ["--source", spec["source"], "--target", spec["target"], "--ops", spec["ops"]]
            prompt += ["--region", spec["find"]] if "find" in spec else []
            trained = self.run("edit", self.field, "-o", edit, *prompt, "--scene", self.scene, *spec.get("flags", []))
            self.run("render", self.field, edit, *self.views, "-o", folder, "--maps")
            mask = draw_mask(regions, spec["region"], size, self.work / f"{name}_region.png")
            view = mask.split(":")[0]
            select = ["--scene", self.scene, "--split", "test"]
            judged = self.run("eval", self.field, edit, *select, "--views", view, "--region-mask", mask)
            overall = self.run("eval", self.field, edit, *select, "--views", ",".join(VIEWS))
            figures = {k: trained[k] for k in ("iterations", "seconds", "seconds_per_iteration")}
            figures |= {k: judged[k] for k in ("d_l1_inside", "d_l1_outside", "d_l1_outside_object")}
            figures |= {k: overall[k] for k in ("d_l1", "s_clip", "mp_clip")}
            if "hues" in spec:
                figures["turned_share"] = turned_share(original, folder, VIEWS, spec["hues"])
            self.report.setdefault("edits", {})[name] = spec | figures
            self.save()
            print(json.dumps({name: figures}), file=sys.stderr, flush=True)
            rows = [
                [picture(original / f"{v}.png", TILE), picture(folder / f"{v}.png", TILE), edit_map(folder, v, TILE)]
                for v in VIEWS
            ]
            titles = ["original", f"{spec['ops']}: {spec['target']}", "added changed removed (r g b)"]
            sheet(rows, titles, TILE).save(self.out / f"lego_{name}.png", optimize=True)

    def bake(self) -> None:
        """Cycles' picture of the baked volume against ours of the same medium, and what view-independence costs."""
        grid = self.work / "field.vdb"
        baked = self.run("bake", self.field, "-o", grid, "--resolution", self.args.resolution)
        same = self.work / "conserving"
        self.run("render", self.field, *self.views, "-o", same, "--compositing", "conserving", "--color", "diffuse")
        cycles = self.work / "cycles"
        script = ROOT / "blender_addon" / "render_volume.py"
        command = [self.args.blender, "-b", "--factory-startup", "--python-exit-code", "1", "--python", script, "--"]
        command += ["--vdb", grid, "--cameras", self.scene / "transforms_test.json", "--views", ",".join(VIEWS)]
        command += ["--out", cycles, "--background", "white", "--resolution", "400", "400", "--step-rate", "0.25"]
        start = time.perf_counter()
        subprocess.run([str(c) for c in command], check=True, stdout=subprocess.DEVNULL)
        seconds = (time.perf_counter() - start) / len(VIEWS)
        original = self.original()
        self.report["bake"] = {
            "resolution": self.args.resolution,
            **{k: baked[k] for k in ("voxels", "bytes", "seconds")},
            "cycles_seconds_per_view": seconds,
            "psnr_cycles_to_engine": float(np.mean([psnr(cycles / f"{v}.png", same / f"{v}.png") for v in VIEWS])),
            "psnr_diffuse_to_view": float(np.mean([psnr(same / f"{v}.png", original / f"{v}.png") for v in VIEWS])),
        }
        self.save()
        print(json.dumps(self.report["bake"]), file=sys.stderr, flush=True)
        rows = [[picture(f / f"{v}.png", TILE) for f in (original, same, cycles)] for v in VIEWS]
        titles = ["field", "view-independent colour", "Cycles, from the .vdb"]
        sheet(rows, titles, TILE).save(self.out / "lego_bake.png", optimize=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", type=Path, required=True)
    parser.add_argument("--scene", type=Path, required=True)
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "results")
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "results")
    parser.add_argument("--only", default="field,edits,bake")
    parser.add_argument("--edits", help="only these edits, by name")
    parser.add_argument("--minutes", type=float, nargs="+", default=[1.0, 2.0, 5.0, 10.0])
    parser.add_argument("--resolution", type=int, default=256)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--blender", default="blender")
    results = Results(parser.parse_args())
    for step in results.args.only.split(","):
        {"field": results.fields, "edits": results.edits, "bake": results.bake}[step]()
    results_page.main()


if __name__ == "__main__":
    main()
