"""Runs the stability suite whole and writes docs/stability.md's tables and plot out of what it found.

    ./dev stability [--build DIR]

Writes docs/results/stability.json, stability.svg and stability.png, and the tables of docs/stability.md.
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
            command = [str(build / program), "--gtest_brief=1", "--gtest_filter=-Page.*"]  # the page is what is written
            if subprocess.run(command, env=environment).returncode != 0:
                sys.exit(f"stability: {program} fails; nothing was written")
            rows += json.loads(path.read_text(encoding="utf-8"))
    return rows


def number(value: float | str | None) -> str:
    if value is None:
        return "—"
    if isinstance(value, str):
        return value
    return "0" if value == 0 else f"{value:.1e}"


def textbook(row: Row) -> str:
    """The worst finite error, and how often there was no number at all."""
    lost = row.get("naive_lost", 0)
    if not lost:
        return number(row.get("naive"))
    share = 100 * lost / row["cases"]
    nothing = f"NaN or ∞ in {share:.0f} %" if share >= 1 else f"NaN or ∞ in {lost:,}"
    return f"{number(row['naive'])}, {nothing}" if "naive" in row else nothing


def merged(rows: list[Row], *keys: str) -> list[Row]:
    """The worst of all rows that agree in these keys."""
    worst: dict[tuple[str, ...], Row] = {}
    for row in rows:
        key = tuple(row[k] for k in keys)
        kept = worst.setdefault(key, row | {"cases": 0, "naive_lost": 0})
        kept["cases"] += row["cases"]
        kept["naive_lost"] += row.get("naive_lost", 0)
        if row["ours"] > kept["ours"]:
            kept |= {"ours": row["ours"], "input": row["input"]}
        if "naive" in row:
            kept["naive"] = max(row["naive"], kept.get("naive", 0))
        worst[key] = kept
    return list(worst.values())


def summary(rows: list[Row]) -> list[Row]:
    """The worst over all inputs, a quantity, part and path a row."""
    return merged(rows, "quantity", "part", "path")


def summary_table(rows: list[Row]) -> str:
    heads = ["quantity", "part", "path", "cases", "textbook", "ours", "promised", "ours is worst at", "unit"]
    lines = [
        [
            row["quantity"],
            row["part"],
            row["path"],
            f"{row['cases']:,}",
            textbook(row),
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
    for row in merged(rows, "quantity", "part", "input"):
        key = row["quantity"], row["part"], row["input"]
        ours = [number(cells[key][path]["ours"]) if path in cells[key] else "" for path in paths]
        lines.append([*key, textbook(row), *ours])
    return table(["quantity", "part", "input", "textbook", *paths], lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "release", help="where the test programs are")
    parser.add_argument("--page-only", action="store_true", help="from the rows measured last")
    args = parser.parse_args()
    file = OUT / "stability.json"
    if not args.page_only:
        rows = measured(args.build)
        lines = ",\n".join(json.dumps(row, ensure_ascii=False) for row in rows)
        file.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
    rows = json.loads(file.read_text(encoding="utf-8"))
    draw(summary(rows), OUT / "stability")
    text = PAGE.read_text(encoding="utf-8")
    text = fill(text, {"stability": summary_table(rows), "stability inputs": full_table(rows)})
    PAGE.write_text(text, encoding="utf-8")
    print(f"{sum(row['cases'] for row in rows):,} numbers compared; {PAGE.relative_to(ROOT)} written")


if __name__ == "__main__":
    main()
