"""Puts the figures of docs/results/*.json into docs/results.md and docs/performance.md, between `figures` markers.

    python bench/results_page.py [--check]

The text around the tables is written by hand; the numbers in the tables never are. `--check` only says whether the
page is up to date (exit code 1 if not).
"""

from __future__ import annotations

import json
import re
import sys
from functools import partial
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
PAGE, FIGURES = ROOT / "docs" / "results.md", ROOT / "docs" / "results" / "lego.json"
ACCURACY_PAGE, ACCURACY_FIGURES = ROOT / "docs" / "accuracy-and-time.md", ROOT / "docs" / "results" / "accuracy.json"
SPEED_PAGE, SPEED_FIGURES = ROOT / "docs" / "performance.md", ROOT / "docs" / "results" / "performance.json"


def processor() -> str:
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    return next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), "unknown")


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


def seed_table(edits: dict[str, dict[str, Any]]) -> str:
    rows = []
    for e in edits.values():
        tries = e["tries"]
        shares = ", ".join(f"{t['asked_share']:.0%}" for t in tries)
        outside = f"{max(t['d_l1_outside_object'] for t in tries):.3f}"
        works = f"{sum(t['works'] for t in tries)} of {len(tries)}"
        rows.append([f'{e["ops"]}: "{e["source"]}" → "{e["target"]}"', works, shares, outside])
    return table(["edit", "works", "shows what was asked, seed by seed", "outside, object: the most"], rows)


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


def range_of(figure: dict[str, float], digits: int, scale: float = 1) -> str:
    """Median (least to greatest)."""
    middle, low, high = (f"{figure[k] * scale:.{digits}f}" for k in ("median", "min", "max"))
    return f"{middle} ({low} to {high})"


def machine_table(machine: dict[str, Any]) -> str:
    rows = [
        ["processor", f"{machine['processor']}, {machine['cores']} cores, {machine['threads']} threads used"],
        ["GEMM 2048³ in float32, GFLOP/s", range_of(machine["gemm_float32"], 0)],
        ["GEMM 2048³ in bfloat16, GFLOP/s", range_of(machine["gemm_bfloat16"], 0)],
    ]
    return table(["what", "measured"], rows)


def kernel_table(kernels: dict[str, Any]) -> str:
    peak = kernels["machine_fused_multiply_add"]["gflops"]
    rows = []
    for name, k in kernels.items():
        if name == "machine_copy":
            rows.append(["memory copied, all threads", "", "", f"{k['gbytes_a_second']:.1f} GB/s", ""])
        elif name == "machine_fused_multiply_add":
            rows.append(["chains of float32 multiply-adds, a thread", "", "", f"{peak:.0f} GFLOP/s", ""])
        else:
            rate = f"{k['gflops']:.0f} GFLOP/s" if "gflops" in k else ""
            share = f"{k['gflops'] / peak:.2f}" if "gflops" in k else ""
            rows.append([name.replace("_", " "), f"{k['ns']:.1f}", f"{k['least_ns']:.1f}", rate, share])
    heads = ["kernel", "ns of a thread a sample, median", "least", "rate", "of the float32 chains' rate"]
    return table(heads, rows)


def training_rows(training: dict[str, Any]) -> list[list[str]]:
    gemm = training["gemm_float32"]["median"]
    plain = training["pytorch_eager_microseconds_a_sample"]["median"]
    rows = []
    for precision, figure in training["microseconds_a_sample"].items():
        share = training["flops_a_sample"] / figure["median"] / 1e3 / gemm
        what = f"training, {precision}"
        rows.append([f"{what}: µs a fitted sample", range_of(figure, 2), ""])
        rows.append([f"{what}: times plain PyTorch's speed", f"{plain / figure['median']:.1f}", "10 / 16"])
        rows.append([f"{what}: of the float32 GEMM rate, all included", f"{share:.2f}", ""])
    return rows


def network_rows(networks: dict[str, Any]) -> list[list[str]]:
    rows = []
    for precision, ns in networks["ns_of_a_thread_a_sample"].items():
        share = networks["flops_a_sample"] / ns * networks["threads"] / networks["gemm_float32"]["median"]
        aim = "0.6 / 0.75" if precision == "float32" else ""
        what = f"both networks, {precision}, forward and backward: of the float32 GEMM rate"
        rows.append([what, f"{share:.2f}", aim])
    return rows


def tower_rows(towers: dict[str, Any] | None) -> list[list[str]]:
    if towers is None:
        return []
    rest = towers["seconds_an_iteration"] - towers["of_them_field_and_rendering"]
    what = f"an iteration guided by towers of ViT-B/32's size ({towers['type']}, 24 pairs), S = 128, s"
    return [
        [what, f"{towers['seconds_an_iteration']:.2f}", ""],
        ["of them field and rendering", f"{towers['of_them_field_and_rendering']:.2f}", ""],
        [
            "the rest against the towers' products at the GEMM rate",
            f"{rest / towers['products_alone_seconds']:.2f}",
            "– / 1.3",
        ],
    ]


def peer_rows(peer: dict[str, Any] | None) -> list[list[str]]:
    if peer is None:
        return []
    ours, theirs = peer["ours"][-1], peer["nerfstudio"]
    last, reached = theirs["curve"][-1], theirs["seconds_to_psnr"]
    times = (reached or last["seconds"]) / ours["seconds"]
    got = f"{reached:.0f} s" if reached else f"{last['psnr']:.1f} dB after {last['seconds']:.0f} s"
    return [
        [f"training to {peer['psnr']:g} dB, s", f"{ours['seconds']:.0f}", ""],
        ["nerfstudio 1.1.5 on these cores (nerfacto in torch)", f"{got}, {last['iterations']:,} iterations", ""],
        ["times nerfstudio's speed", f"{'' if reached else 'over '}{times:.0f}", "10 / 25"],
    ]


def image_rows(images: dict[str, Any]) -> list[list[str]]:
    lego = json.loads(FIGURES.read_text(encoding="utf-8"))["field"][-1]
    rows = [[f"memory while training lego for {lego['minutes']:g} minutes, GiB", f"{lego['peak_mib'] / 1024:.2f}"]]
    rows[0].append("1.5 / 0.7")
    for count, figures in images.items():
        memory, step = figures["peak_mib"] / 1024, figures["seconds_an_iteration"]
        what = f"{int(count):,} images of 1920×1080: memory, GiB; milliseconds an iteration"
        rows.append([what, f"{memory:.2f}; {1000 * step:.0f}", "6; " if int(count) > 1000 else ""])
    return rows


def speed_table(report: dict[str, Any]) -> str:
    scaling, edit, bake = report["scaling"], report["edit"], report["bake"]
    threads = report["machine"]["threads"]
    faster = scaling[f"samples_a_second_{threads}"]["median"] / scaling["samples_a_second_1"]["median"]
    thousand = 1000 / 60  # iterations; minutes
    edits = []
    elsewhere = report.get("measured_on", {}).get("edit", report["machine"]["processor"])
    where = "" if elsewhere == report["machine"]["processor"] else f", on another machine ({elsewhere})"
    for operations, seconds in edit.items():
        what = f"1,000 iterations of an edit ({operations}), S = 128{where}, min"
        edits.append([what, range_of(seconds["seconds_an_iteration"], 1, thousand), "6 / 3"])
        field = range_of(seconds["of_them_field_and_rendering"], 1, thousand)
        edits.append(["of them field and rendering", field, ""])
    baked = "field with an edit" if bake["with_edit"] else "field"
    rows = [
        *training_rows(report["training"]),
        *network_rows(report["networks"]),
        *peer_rows(report.get("peer")),
        [f"training, 1 to {threads} threads: times faster", f"{faster:.2f}", "1.8 / 1.95"],
        ["a 400x400 view of the field, s", range_of(report["render"]["seconds_a_view"], 3), "0.25 / 0.1"],
        *edits,
        *tower_rows(report.get("towers")),
        *image_rows(report.get("images", {})),
        [f"bake of a {baked}, 256³, s", range_of(bake["seconds"], 1), "20 / 5"],
    ]
    return table(["what", "measured", "at least / aim"], rows)


# What each part of the growth table turns, and what a row's value counts.
GROWTH = {
    "samples": "training, samples an iteration",
    "table": "training, table entries a level, log₂",
    "width": "training, width of the networks",
    "drawing": "a view of 400×400 × the square of",
    "baking": "a bake, voxels an edge",
}


def growth_table(growth: dict[str, list[dict[str, Any]]]) -> str:
    rows = []
    for part, what in GROWTH.items():
        for g in growth[part]:
            seconds = g["ms_an_iteration"] / 1000 if "ms_an_iteration" in g else g["seconds"]
            each = number(g.get("microseconds_a_sample"), 2)
            rows.append([what, f"{g['value']:,}", f"{seconds:.3g}", each, number(g.get("file_mib"), 1)])
            rows[-1].append(f"{g['peak_mib']:,}")
    return table(["what", "of it", "seconds", "µs a sample", "file, MiB", "memory, MiB"], rows)


# The figures of each sweep's table: name, heading, digits.
SWEEP_FIGURES = {
    "training": [("psnr", "PSNR, dB", 2), ("iterations", "iterations", 0), ("seconds_per_view", "seconds a view", 2)],
    "rendering": [("psnr", "PSNR to converged, dB", 1)],
    "editing": [("mp_clip", "MP_CLIP", 3), ("s_clip", "S_CLIP", 3), ("d_l1_inside", "change inside", 3)]
    + [("d_l1_outside", "outside", 4), ("d_l1_outside_object", "outside, object", 4)],
    "cycles": [("psnr", "PSNR to the engine, dB", 2)],
    "baking": [("psnr", "PSNR to the field, dB", 2), ("mib", "MiB", 1), ("voxels", "voxels", 0)],
}


def sweep_table(sweep: str, report: dict[str, Any]) -> str:
    """Every point, knob by knob from the fastest on; bold: nothing is both faster and better."""
    figures = SWEEP_FIGURES[sweep]
    front = {(p["knob"], p["value"]) for p in report["fronts"][sweep][figures[0][0]]}
    points = [p for p in report["points"] if p["sweep"] == sweep]
    usual = next(p for p in points if p["usual"])["figures"]["seconds"]
    knobs = list(dict.fromkeys(p["knob"] for p in points))
    rows = []
    for p in sorted(points, key=lambda p: (knobs.index(p["knob"]), p["figures"]["seconds"])):
        value = f"{p['value']} (usual)" if p["usual"] else p["value"]
        shown = f"**{value}**" if (p["knob"], p["value"]) in front else value
        seconds = p["figures"]["seconds"]
        cells = [f"{p['figures'][name]:,.{digits}f}" if name in p["figures"] else "" for name, _, digits in figures]
        rows.append([p["knob"], shown, f"{seconds:.3g}", f"{seconds / usual:.2f}", *cells])
    return table(["knob", "value", "seconds", "of the usual", *(head for _, head, _ in figures)], rows)


def accuracy_machine(report: dict[str, Any]) -> str:
    gemm = range_of(report["gemm_float32"], 0)
    return f"Measured on {report['processor']}; GEMM 2048³ in float32 {gemm} GFLOP/s on the same cores."


MAKERS = {
    "field": field_table,
    "edits": edit_table,
    "seeds": seed_table,
    "bake": bake_table,
    "machine": machine_table,
    "kernels": kernel_table,
    "speed": speed_table,
    "growth": growth_table,
    "accuracy machine": accuracy_machine,
} | {sweep: partial(sweep_table, sweep) for sweep in SWEEP_FIGURES}


def fill(page: str, texts: dict[str, str]) -> str:
    """The page with each `<!-- figures: NAME -->` … `<!-- end -->` holding that text."""
    for name, text in texts.items():
        marked = re.compile(rf"(<!-- figures: {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        page = marked.sub(lambda m, text=text: f"{m[1]}{text}\n{m[2]}", page)
    return page


def filled(page: str, report: dict[str, Any]) -> str:
    """The page with its tables as they are now."""
    return fill(page, {name: make(report[name]) for name, make in MAKERS.items() if name in report})


def speed_report() -> dict[str, Any]:
    """The performance figures; `speed` is made of several of them."""
    report = json.loads(SPEED_FIGURES.read_text(encoding="utf-8"))
    made = {"machine": report["machine"], "kernels": report["kernels"], "speed": report}
    return made | {"growth": report["growth"]} if "growth" in report else made


def accuracy_report() -> dict[str, Any]:
    report = json.loads(ACCURACY_FIGURES.read_text(encoding="utf-8"))
    return {"accuracy machine": report} | dict.fromkeys(SWEEP_FIGURES, report)


def main() -> int:
    stale = False
    lego = json.loads(FIGURES.read_text(encoding="utf-8"))
    for path, report in ((PAGE, lego), (SPEED_PAGE, speed_report()), (ACCURACY_PAGE, accuracy_report())):
        page = path.read_text(encoding="utf-8")
        new = filled(page, report)
        stale = stale or new != page
        if "--check" not in sys.argv:
            path.write_text(new, encoding="utf-8")
    return 1 if stale and "--check" in sys.argv else 0


if __name__ == "__main__":
    sys.exit(main())
