"""Runs the stability suite whole and writes docs/stability.md's tables and plot out of what it found.

    ./dev stability [--build DIR]

Writes docs/results/stability.json, stability.svg and stability.png, and the tables of docs/stability.md.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from results_page import fill, table
from stability_chart import draw

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "stability.md"
OUT = ROOT / "docs" / "results"
PROGRAMS = ("test_stability_kernels", "test_stability")

Row = dict[str, Any]


def measured(build: Path) -> list[Row]:
    """The rows of both programs. Paths that this machine lacks (bfloat16 tiles) are missing."""
    rows: list[Row] = []
    for program in PROGRAMS:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "rows.json"
            environment = os.environ | {"FIELDGRAFT_STABILITY_OUT": str(path)}
            command = [str(build / program), "--gtest_brief=1"]
            if subprocess.run(command, env=environment).returncode != 0:
                sys.exit(f"stability: {program} fails; nothing was written")
            rows += json.loads(path.read_text(encoding="utf-8"))
    return rows


def number(value: float | str | None) -> str:
    if value is None:
        return "—"
    if isinstance(value, str):
        return "NaN or ∞"
    return "0" if value == 0 else f"{value:.1e}"


def size(value: float | str) -> float:
    return math.inf if isinstance(value, str) else value


def summary(rows: list[Row]) -> list[Row]:
    """The worst over all inputs, a quantity, part and path a row."""
    worst: dict[tuple[str, str, str], Row] = {}
    for row in rows:
        key = (row["quantity"], row["part"], row["path"])
        kept = worst.setdefault(key, row | {"cases": 0})
        kept["cases"] += row["cases"]
        if size(row["ours"]) > size(kept["ours"]):
            kept |= {"ours": row["ours"], "input": row["input"]}
        if "naive" in row and size(row["naive"]) > size(kept["naive"]):
            kept["naive"] = row["naive"]
        worst[key] = kept
    return list(worst.values())


def summary_table(rows: list[Row]) -> str:
    heads = ["quantity", "part", "path", "cases", "textbook", "ours", "promised", "ours is worst at", "errors are shares of"]
    lines = [
        [
            row["quantity"],
            row["part"],
            row["path"],
            f"{row['cases']:,}",
            number(row.get("naive")),
            number(row["ours"]),
            f"{row['bound']:.1e}",
            row["input"] if row["ours"] else "—",
            row["unit"],
        ]
        for row in summary(rows)
    ]
    return table(heads, lines)


def full_table(rows: list[Row]) -> str:
    """A row a quantity, part and class of inputs; the paths beside each other."""
    paths = ["reference", "SIMD", "bfloat16", "torch"]
    cells: dict[tuple[str, str, str], dict[str, Row]] = {}
    for row in rows:
        cells.setdefault((row["quantity"], row["part"], row["input"]), {})[row["path"]] = row
    lines = []
    for (quantity, part, kind), found in cells.items():
        naive = max((row["naive"] for row in found.values() if "naive" in row), key=size, default=None)
        ours = [number(found[path]["ours"]) if path in found else "" for path in paths]
        lines.append([quantity, part, kind, number(naive), *ours])
    return table(["quantity", "part", "input", "textbook", *paths], lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "release", help="where the test programs are")
    parser.add_argument("--page-only", action="store_true", help="from the rows measured last")
    args = parser.parse_args()
    file = OUT / "stability.json"
    if not args.page_only:
        rows = measured(args.build)
        file.write_text(json.dumps(rows, indent=0, ensure_ascii=False) + "\n", encoding="utf-8")
    rows = json.loads(file.read_text(encoding="utf-8"))
    draw(summary(rows), OUT / "stability")
    text = PAGE.read_text(encoding="utf-8")
    text = fill(text, {"stability": summary_table(rows), "stability inputs": full_table(rows)})
    PAGE.write_text(text, encoding="utf-8")
    print(f"{sum(row['cases'] for row in rows):,} numbers compared; {PAGE.relative_to(ROOT)} written")


if __name__ == "__main__":
    main()
