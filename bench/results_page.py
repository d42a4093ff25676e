"""Puts the figures of docs/results/lego.json into docs/results.md, between its `figures` markers.

    python bench/results_page.py [--check]

The text around the tables is written by hand; the numbers in the tables never are. `--check` only says whether the
page is up to date (exit code 1 if not).
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
PAGE, FIGURES = ROOT / "docs" / "results.md", ROOT / "docs" / "results" / "lego.json"


def table(heads: list[str], rows: list[list[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def number(value: float | None, digits: int) -> str:
    return "not measured" if value is None else f"{value:.{digits}f}"


def field_table(rows: list[dict[str, Any]]) -> str:
    heads = ["minutes", "iterations", "PSNR, dB", "SSIM", "peak memory, MiB", "seconds a 400x400 view"]
    heads += ["µs a sample", "times plain PyTorch's speed"]
    return table(
        heads,
        [
            [
                f"{r['minutes']:g}",
                f"{r['iterations']:,}",
                number(r["psnr"], 2),
                number(r["ssim"], 3),
                number(r.get("peak_mib"), 0),
                number(r.get("seconds_per_view"), 2),
                number(r.get("microseconds_a_sample"), 2),
                number(r.get("times_faster_than_pytorch_eager"), 1),
            ]
            for r in rows
        ],
    )


def edit_table(edits: dict[str, dict[str, Any]]) -> str:
    heads = ["edit", "iterations", "seconds", "D_L1 inside", "outside", "outside, object"]
    heads += ["S_CLIP", "MP_CLIP", "turned"]
    rows = []
    for e in edits.values():
        prompt = f'{e["ops"]}: "{e["source"]}" → "{e["target"]}"'
        figures = [
            number(e.get(k), 3) for k in ("d_l1_inside", "d_l1_outside", "d_l1_outside_object", "s_clip", "mp_clip")
        ]
        turned = f"{e['turned_share']:.0%}" if "turned_share" in e else ""
        rows.append([prompt, f"{e['iterations']:,}", number(e["seconds"], 0), *figures, turned])
    return table(heads, rows)


def bake_table(bake: dict[str, Any]) -> str:
    rows = [
        ["grid", f"{bake['resolution']}³, {bake['voxels']:,} active voxels"],
        ["time", f"{bake['seconds']:.1f} s"],
        ["file", f"{bake['bytes'] / 2**20:.1f} MiB"],
        ["Cycles, a 400x400 view", f"{bake['cycles_seconds_per_view']:.1f} s"],
        ["Cycles against our render, same view-independent colour", f"{bake['psnr_cycles_to_engine']:.2f} dB"],
        ["our render: view-independent colour against view-dependent", f"{bake['psnr_diffuse_to_view']:.2f} dB"],
    ]
    return table(["what", "measured"], rows)


def filled(page: str, report: dict[str, Any]) -> str:
    """The page with each `<!-- figures: NAME -->` … `<!-- end -->` holding that table as it is now."""
    makers = {"field": field_table, "edits": edit_table, "bake": bake_table}
    for name, make in makers.items():
        if name in report:
            marked = re.compile(rf"(<!-- figures: {name} -->\n).*?(<!-- end -->)", re.DOTALL)
            text = make(report[name])
            page = marked.sub(lambda m, text=text: f"{m[1]}{text}\n{m[2]}", page)
    return page


def main() -> int:
    page = PAGE.read_text(encoding="utf-8")
    new = filled(page, json.loads(FIGURES.read_text(encoding="utf-8")))
    if "--check" in sys.argv:
        return 0 if new == page else 1
    PAGE.write_text(new, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
