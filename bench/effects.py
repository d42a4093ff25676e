"""What each combination of operations costs: docs/effects.md's table and plot.

    ./dev effects --scene DIR --field FIELD [--iterations N] [--page-only]

For every non-empty set of add, remove and change, one after the other in one run: the plan's own counts (`fieldgraft
info`), seconds an iteration of a short edit of the same prompt and of them f's and g's, then drawing and baking the
field with it, beside drawing and baking the field alone. FIELD is a trained field of the scene (lego). Writes
docs/results/effects.json, effects.svg, effects.png and the tables of docs/effects.md.
"""

from __future__ import annotations

import argparse
import json
import statistics
import tempfile
from pathlib import Path
from typing import Any

import results_page
from run import commit, done_event, write_report
from stability_chart import INK, OURS, PALE, TEXTBOOK, Canvas

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "effects.md"
OUT = ROOT / "docs" / "results"
ALL = "add,remove,change"
COMBINATIONS = ["change", "remove", "add", "remove,change", "add,change", "add,remove", ALL]
PROMPT = ["--source", "yellow bulldozer", "--target", "red bulldozer"]


class Effects:
    def __init__(self, args: argparse.Namespace, folder: Path) -> None:
        self.args, self.folder = args, folder

    def run(self, *command: Any) -> dict[str, Any]:
        return done_event([self.args.program, *command])

    def drawn(self, *edit: Path) -> float:
        """Seconds a view, the middle of five: files are written in it, too, for both."""
        views = ["--scene", self.args.scene, "--split", "test", "--views", "r_0,r_104", "-o", self.folder / "views"]
        runs = [self.run("render", self.args.field, *edit, *views)["seconds_per_view"] for _ in range(5)]
        return round(statistics.median(runs), 4)

    def baked(self, *edit: Path) -> dict[str, Any]:
        runs = [self.run("bake", self.args.field, *edit, "-o", self.folder / "grid.vdb") for _ in range(3)]
        seconds = statistics.median(run["seconds"] for run in runs)
        return {"seconds": round(seconds, 3), "voxels": runs[0]["voxels"], "bytes": runs[0]["bytes"]}

    def combination(self, operations: str) -> dict[str, Any]:
        edit = self.folder / f"{operations}.safetensors"
        size = ["--iterations", self.args.iterations, "--patch", self.args.patch]
        done = self.run(
            "edit", self.args.field, "-o", edit, "--scene", self.args.scene, "--ops", operations, *PROMPT, *size
        )
        info = self.run("info", edit)["files"][0]
        return {
            "operations": operations,
            "cost": info["plan"]["cost"],
            "support_share": info["support_share"],
            "edit_bytes": edit.stat().st_size,
            "seconds_an_iteration": done["seconds_per_iteration"],
            "field_seconds_an_iteration": done["field_seconds_per_iteration"],
            "seconds_a_view": self.drawn(edit),
            "bake": self.baked(edit),
        }

    def measure(self) -> dict[str, Any]:
        rows = []
        for operations in COMBINATIONS:
            rows.append(self.combination(operations))
            print(json.dumps(rows[-1]), flush=True)
        return {
            "commit": commit(),
            "processor": results_page.processor(),
            "iterations": self.args.iterations,
            "patch": self.args.patch,
            "alone": {"seconds_a_view": self.drawn(), "bake": self.baked()},
            "combinations": rows,
        }


def counted_table(rows: list[dict[str, Any]]) -> str:
    heads = ["operations", "parameters", "state, MiB", "edit file, MiB", "operations a sample, training (drawing)"]
    heads += ["bytes a sample, training (drawing)", "passes through the tower"]
    cells = []
    for row in rows:
        cost = row["cost"]
        work, traffic = cost["operations_a_sample"], cost["bytes_a_sample"]
        cells.append(
            [
                row["operations"],
                f"{cost['parameters']:,}",
                f"{cost['state_bytes'] / 2**20:.2f}",
                f"{row['edit_bytes'] / 2**20:.2f}",
                f"{work['training']:,} ({work['drawing']:,})",
                f"{traffic['training']:,} ({traffic['drawing']:,})",
                str(cost["tower_passes"]),
            ]
        )
    return results_page.table(heads, cells)


def timed_table(report: dict[str, Any]) -> str:
    rows, alone = report["combinations"], report["alone"]
    whole = rows[-1]
    heads = ["operations", "s an iteration", "of all three", "of it field and rendering", "of all three's"]
    heads += ["support, % of the box", "a view, of the field's", "bake 256³, of the field's", ".vdb, MiB"]
    cells = []
    for row in rows:
        field = row["field_seconds_an_iteration"]
        cells.append(
            [
                row["operations"],
                f"{row['seconds_an_iteration']:.3f}",
                f"{row['seconds_an_iteration'] / whole['seconds_an_iteration']:.2f}",
                f"{field:.4f}",
                f"{field / whole['field_seconds_an_iteration']:.2f}",
                f"{100 * row['support_share']:.2f}",
                f"{row['seconds_a_view'] / alone['seconds_a_view']:.2f}",
                f"{row['bake']['seconds'] / alone['bake']['seconds']:.2f}",
                f"{row['bake']['bytes'] / 2**20:.1f}",
            ]
        )
    return results_page.table(heads, cells)


def draw(report: dict[str, Any]) -> None:
    rows = report["combinations"]
    top, line, left, right = 64, 44, 200, 940
    canvas = Canvas(top + line * len(rows) + 40)
    canvas.text(left, 26, "Seconds of an iteration, of those with all three on", 15)
    canvas.text(left, 46, "field and rendering", 12, OURS)
    canvas.text(left + 170, 46, "the whole iteration, the guide's towers included", 12, TEXTBOOK)
    most = max(row["seconds_an_iteration"] / rows[-1]["seconds_an_iteration"] for row in rows)
    scale = (right - left) / max(1.0, most)
    bottom = top + line * len(rows)
    for share in (0, 0.25, 0.5, 0.75, 1):
        canvas.line(left + scale * share, top, left + scale * share, bottom, PALE)
        canvas.text(left + scale * share, bottom + 18, f"{share:g}", 12, INK, "middle")
    for k, row in enumerate(rows):
        y = top + line * k + 14
        canvas.text(left - 12, y + 10, row["operations"].replace(",", " + "), 12, INK, "end")
        for key, color, dy in (("field_seconds_an_iteration", OURS, 0), ("seconds_an_iteration", TEXTBOOK, 14)):
            share = row[key] / rows[-1][key]
            canvas.line(left, y + dy, left + scale * share, y + dy, color, 9)
            canvas.text(left + scale * share + 8, y + dy + 4, f"{share:.2f}", 11, color)
    canvas.write(OUT / "effects")


def write_page(report: dict[str, Any]) -> None:
    draw(report)
    page = PAGE.read_text(encoding="utf-8")
    tables = {"counted": counted_table(report["combinations"]), "timed": timed_table(report)}
    page = results_page.fill(page, tables)
    PAGE.write_text(page, encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", type=Path, required=True)
    parser.add_argument("--scene", type=Path, required=True)
    parser.add_argument("--field", type=Path, required=True)
    parser.add_argument("--iterations", type=int, default=120)
    parser.add_argument("--patch", type=int, default=96)
    parser.add_argument("--page-only", action="store_true", help="write the page again from effects.json")
    args = parser.parse_args()
    figures = OUT / "effects.json"
    if not args.page_only:
        with tempfile.TemporaryDirectory() as folder:
            report = Effects(args, Path(folder)).measure()
        write_report(figures, report)
    write_page(json.loads(figures.read_text()))


if __name__ == "__main__":
    main()
