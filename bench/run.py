"""Accuracy and timings of the whole path on one scene, beside a GEMM reading of the same run.

    ./dev bench [--scene DIR] [--minutes 1 2 5 10] [--threads N] [--out FILE.json]
    ./dev bench --page --scene DIR --field FIELD [--edit EDIT]       writes docs/performance.md (performance.py)

Writes one JSON object: machine, commit, GFLOP/s of a float32 GEMM, the kernels by themselves (`kernels.cpp`),
microseconds a sample of the same training step in plain PyTorch (`eager.py`), and for each training budget the PSNR and
SSIM on the scene's test views, iterations, microseconds a sample that was fitted (marching, occupancy and all else
included), how many times faster than PyTorch that is, time per view rendered. Results are checked (finite, better than
grey) before they are reported; times are
never judged.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import eager

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent


def done_event(command: list[str | Path]) -> dict:
    """Runs a command with --json, shows its progress events' ends, returns the `done` object."""
    result = subprocess.run([*map(str, command), "--json"], stdout=subprocess.PIPE, text=True)
    events = [json.loads(line) for line in result.stdout.splitlines() if line.startswith("{")]
    done = [e for e in events if e.get("event") == "done"]
    if result.returncode != 0 or not done:
        sys.exit(f"bench: {' '.join(map(str, command))} ended with exit code {result.returncode}")
    return done[-1]


def gemm_gflops(threads: int, size: int = 2048, runs: int = 5, bfloat16: bool = False) -> dict:
    import torch

    torch.set_num_threads(threads)
    kind = torch.bfloat16 if bfloat16 else torch.float32
    a, b = torch.randn(size, size).to(kind), torch.randn(size, size).to(kind)
    torch.mm(a, b)
    rates = []
    for _ in range(runs):
        start = time.perf_counter()
        torch.mm(a, b)
        rates.append(2 * size**3 / (time.perf_counter() - start) / 1e9)
    return {"median": round(statistics.median(rates), 1), "min": round(min(rates), 1), "max": round(max(rates), 1)}


def write_report(path: Path, report: dict) -> None:
    """Whole or not at all."""
    part = path.with_suffix(".part")
    part.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    os.replace(part, path)


def commit() -> str:
    result = subprocess.run(["git", "-C", ROOT, "rev-parse", "--short", "HEAD"], stdout=subprocess.PIPE, text=True)
    return result.stdout.strip()


def measure(program: Path, scene: Path, minutes: float, threads: int, work: Path) -> dict:
    field = work / f"field_{minutes:g}.safetensors"
    common = ["--threads", threads]
    train = done_event([program, "train", scene, "-o", field, "--minutes", minutes, *common])
    score = done_event([program, "eval", field, "--scene", scene, "--split", "test", *common])
    if not (math.isfinite(score["psnr"]) and score["psnr"] > 10):
        sys.exit(f"bench: {score['psnr']} dB after {minutes} minutes is not a result worth timing")
    keys = ("iterations", "samples", "seconds", "peak_mib")
    each = train["seconds"] / train["samples"] * 1e6
    config = done_event([program, "info", field])["files"][0]["config"]
    plain = eager.microseconds_a_sample(threads, config)
    return {
        "minutes": minutes,
        **{k: train[k] for k in keys},
        "log2_table_size": config["log2_table_size"],
        "hidden": config["color_hidden"],
        "microseconds_a_sample": round(each, 3),
        "pytorch_eager_microseconds_a_sample": plain,
        "times_faster_than_pytorch_eager": round(plain["median"] / each, 1),
        **{k: score[k] for k in ("psnr", "ssim", "seconds_per_view") if k in score},
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", type=Path, required=True)
    parser.add_argument("--scene", type=Path, default=ROOT / "demo" / "scene")
    parser.add_argument("--minutes", type=float, nargs="+", default=[1.0])
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--out", type=Path)
    parser.add_argument("--page", action="store_true", help="measure what docs/performance.md shows")
    parser.add_argument("--field", type=Path, help="of the scene, for --page")
    parser.add_argument("--edit", type=Path, help="of that field, for --page")
    parts = "kernels,training,scaling,render,edit,towers,bake,images,growth"
    parser.add_argument("--only", default=parts, help=f"parts of --page: {parts}, and peer")
    parser.add_argument("--peer-python", type=Path, help="Python of an environment with nerfstudio, for the part peer")
    parser.add_argument("--repeats", type=int, default=3, help="of every figure of --page")
    args = parser.parse_args()
    if args.page:
        if args.field is None:
            parser.error("--page needs --field, a trained field of the scene")
        if "peer" in args.only.split(",") and args.peer_python is None:
            parser.error("the part peer needs --peer-python (peer_nerfstudio.py says what of)")
        import performance

        performance.measure_all(args)
        return
    kernels = subprocess.run(
        [args.program.parent / "kernel_bench", "--threads", str(args.threads)], stdout=subprocess.PIPE, check=True
    )
    report = {
        "machine": {"processor": platform.processor() or platform.machine(), "cores": os.cpu_count()},
        "commit": commit(),
        "threads": args.threads,
        "gemm_gflops_float32": gemm_gflops(args.threads),
        "kernels": json.loads(kernels.stdout),
        "scene": args.scene.name,
        "training": [],
    }
    with tempfile.TemporaryDirectory() as work:
        for minutes in args.minutes:
            report["training"].append(measure(args.program, args.scene, minutes, args.threads, Path(work)))
            print(json.dumps(report["training"][-1]), file=sys.stderr, flush=True)
    if args.out:
        write_report(args.out, report)
    print(json.dumps(report, indent=2))


if __name__ == "__main__":
    main()
