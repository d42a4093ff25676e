"""What docs/results.md shows: a field's accuracy over time, edits from text alone, and the bake, on the lego scene.

    ./dev results --scene DIR [--out docs/results] [--work DIR] [--only field,edits,bake,seeds] [--minutes 1 2 5 10]

Writes OUT/lego.json and OUT/lego_*.png, and the tables of docs/results.md. A field that WORK holds already is not
trained again. The regions that edits are judged by are drawn by hand (bench/lego/regions.json); the edits never see
them. `seeds` tries each edit with several seeds (`--seeds`) and counts how often it works: what was asked for is to be
seen (`asked_share`) and the rest of the object stays as it was.
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
from run import commit, done_event, measure, write_report

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path.insert(0, str(ROOT / "demo"))

from sheets import edit_map, picture, sheet  # noqa: E402

VIEWS = ["r_176", "r_0", "r_152"]
TILE = 256
CHANGED, WHITE = 0.1, 0.9
LEAST_CHANGE = 0.05  # D_L1 inside the region
MOST_OUTSIDE = 0.015  # D_L1 outside, over the object
MOST_OF_IT = 0.6


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


def render_in_cycles(blender: str, grid: Path, scene: Path, out: Path, options: list[Any]) -> None:
    script = ROOT / "blender_addon" / "render_volume.py"
    command = [blender, "-b", "--factory-startup", "--python-exit-code", "1", "--python", script, "--"]
    command += ["--vdb", grid, "--cameras", scene / "transforms_test.json", "--views", ",".join(VIEWS)]
    command += ["--out", out, "--background", "white", "--resolution", "400", "400", *options]
    subprocess.run([str(c) for c in command], check=True, stdout=subprocess.DEVNULL)


def asked_share(before: Path, after: Path, mask: Path, asked: dict[str, Any]) -> float:
    """How much of a test view's region shows what an edit asked for.

    `asked` has `of`: "yellow" (pixels of that hue before), "changed" (pixels whose colour moved by more than
    `CHANGED`) or "object" (pixels that were not white); and `hue` (from, to; pixels of low saturation do not
    count) or `white`. Nothing to count: 0.
    """
    was, now = pixels(before), pixels(after)
    inside = np.asarray(Image.open(mask).convert("L")) > 127
    hue_before, strength_before = hue_and_strength(was)
    counted = {
        "yellow": within(hue_before, 35, 65) & (strength_before > 0.3),
        "changed": np.abs(now - was).mean(-1) > CHANGED,
        "object": was.min(-1) < WHITE,
    }[asked["of"]] & inside
    hue, strength = hue_and_strength(now)
    shows = now.min(-1) >= WHITE if asked.get("white") else within(hue, *asked["hue"]) & (strength > 0.2)
    return float((shows & counted).sum() / max(1, counted.sum()))


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
        write_report(self.file, self.report)

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

    def specs(self) -> list[dict[str, Any]]:
        wanted = self.args.edits.split(",") if self.args.edits else None
        specs = json.loads((HERE / "lego" / "edits.json").read_text())
        return [s for s in specs if not wanted or s["name"] in wanted]

    def mask(self, spec: dict[str, Any]) -> tuple[str, Path]:
        """The view, and the hand-drawn region over it."""
        regions = json.loads((HERE / "lego" / "regions.json").read_text())
        size = Image.open(self.original() / f"{VIEWS[0]}.png").size
        view, file = draw_mask(regions, spec["region"], size, self.work / f"{spec['name']}_region.png").split(":")
        return view, Path(file)

    def edit(self, spec: dict[str, Any], edit: Path, seed: int) -> dict[str, Any]:
        prompt = ["--source", spec["source"], "--target", spec["target"], "--ops", spec["ops"]]
        prompt += ["--region", spec["find"]] if "find" in spec else []
        prompt += ["--scene", self.scene, "--seed", seed, *spec.get("flags", [])]
        return self.run("edit", self.field, "-o", edit, *prompt)

    def edits(self) -> None:
        original = self.original()
        for spec in self.specs():
            name = spec["name"]
            edit, folder = self.work / f"{name}.safetensors", self.work / name
            trained = self.edit(spec, edit, 0)
            self.run("render", self.field, edit, *self.views, "-o", folder, "--maps")
            view, mask = self.mask(spec)
            select = ["--scene", self.scene, "--split", "test"]
            judged = self.run("eval", self.field, edit, *select, "--views", view, "--region-mask", f"{view}:{mask}")
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

    def seeds(self) -> None:
        """Each edit with seeds 0, 1, …: one figure a seed, and a sheet of the judged view under every seed."""
        original = self.original()
        for spec in self.specs():
            view, mask = self.mask(spec)
            tries, tiles = [], [picture(original / f"{view}.png", TILE)]
            for seed in range(self.args.seeds):
                edit, folder = self.work / "seed.safetensors", self.work / "seed"
                edit.unlink(missing_ok=True)
                self.edit(spec, edit, seed)
                select = ["--scene", self.scene, "--split", "test", "--views", view]
                self.run("render", self.field, edit, *select, "-o", folder)
                judged = self.run("eval", self.field, edit, *select, "--region-mask", f"{view}:{mask}")
                after = folder / f"{view}.png"
                figures = {k: judged[k] for k in ("d_l1_inside", "d_l1_outside_object")}
                figures["asked_share"] = asked_share(original / f"{view}.png", after, mask, spec["asked"])
                figures["works"] = (
                    figures["asked_share"] >= MOST_OF_IT
                    and figures["d_l1_inside"] >= LEAST_CHANGE
                    and figures["d_l1_outside_object"] < MOST_OUTSIDE
                )
                print(json.dumps({spec["name"]: {"seed": seed} | figures}), file=sys.stderr, flush=True)
                tries.append({"seed": seed} | figures)
                tiles.append(picture(after, TILE))
            self.report.setdefault("seeds", {})[spec["name"]] = {k: spec[k] for k in ("source", "target", "ops")} | {
                "tries": tries
            }
            self.save()
            titles = ["original", *(f"seed {t['seed']}{'' if t['works'] else ': fails'}" for t in tries)]
            sheet([tiles], titles, TILE).save(self.out / f"lego_seeds_{spec['name']}.png", optimize=True)

    def bake(self) -> None:
        """Cycles' picture of the baked volume against ours of the same medium, and what view-independence costs."""
        grid = self.work / "field.vdb"
        baked = self.run("bake", self.field, "-o", grid, "--resolution", self.args.resolution)
        same = self.work / "conserving"
        self.run("render", self.field, *self.views, "-o", same, "--compositing", "conserving", "--color", "diffuse")
        cycles = self.work / "cycles"
        start = time.perf_counter()
        render_in_cycles(self.args.blender, grid, self.scene, cycles, ["--step-rate", "0.25"])
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
    parser.add_argument("--seeds", type=int, default=5, help="seeds of each edit")
    parser.add_argument("--minutes", type=float, nargs="+", default=[1.0, 2.0, 5.0, 10.0])
    parser.add_argument("--resolution", type=int, default=256)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--blender", default="blender")
    results = Results(parser.parse_args())
    for step in results.args.only.split(","):
        {"field": results.fields, "edits": results.edits, "bake": results.bake, "seeds": results.seeds}[step]()
    results_page.main()


if __name__ == "__main__":
    main()
