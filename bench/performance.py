"""How fast the core is on a scene, each figure beside what the machine could do in the same run.

    ./dev bench --page --scene DIR --field FIELD.safetensors [--edit EDIT.safetensors] [--only kernels,training,…]

Writes docs/results/performance.json and the tables of docs/performance.md. Every figure is the median of its
`--repeats` with the least and the greatest. FIELD is a trained field of the scene (`./dev results` leaves one in its
work folder).
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import eager
import many_images
import random_clip
import results_page
from growth import Growth
from run import commit, done_event, gemm_gflops, write_report

ROOT = Path(__file__).resolve().parent.parent
FIGURES = ROOT / "docs" / "results" / "performance.json"


def flops_a_sample(config: dict[str, Any]) -> int:
    """Products of one sample, forward and backward: every weight is used three times (value, gradient of the input and
    of the weight), two operations each. The direction's part is computed once a ray."""
    density, color, size = config["density_hidden"], config["color_hidden"], config["feature_size"]
    density_weights = config["levels"] * config["features_per_level"] * density + density * size
    return 3 * 2 * (density_weights + size * color + color * color + color * 3)


def spread(values: list[float], digits: int = 3) -> dict[str, float]:
    shown = {"median": statistics.median(values), "min": min(values), "max": max(values)}
    return {k: round(v, digits) for k, v in shown.items()}


class Performance:
    def __init__(self, args: Any) -> None:
        self.args, self.program = args, args.program
        self.report: dict[str, Any] = json.loads(FIGURES.read_text()) if FIGURES.exists() else {}

    def run(self, *command: Any) -> dict[str, Any]:
        return done_event([self.program, *command])

    def config(self, field: Path) -> dict[str, Any]:
        return self.run("info", field)["files"][0]["config"]

    def save(self) -> None:
        self.report["commit"] = commit()
        write_report(FIGURES, self.report)

    def machine(self) -> None:
        self.report["machine"] = {
            "processor": results_page.processor(),
            "cores": os.cpu_count(),
            "threads": self.args.threads,
            "gemm_float32": gemm_gflops(self.args.threads),
            "gemm_bfloat16": gemm_gflops(self.args.threads, bfloat16=True),
        }

    def kernels(self) -> None:
        config = self.config(self.args.field)
        command = [self.program.parent / "kernel_bench", "--threads", self.args.threads, "--seconds", "1"]
        command += ["--levels", config["levels"], "--features", config["features_per_level"]]
        command += ["--table", config["log2_table_size"], "--hidden", config["color_hidden"]]
        done = subprocess.run([str(c) for c in command], stdout=subprocess.PIPE, check=True)
        # Kernels' rates are a thread's, all threads at work; the GEMM's is all threads' together.
        self.report["kernels"] = json.loads(done.stdout)
        self.report["networks"] = {
            "config": config,
            "flops_a_sample": flops_a_sample(config),
            "gemm_float32": gemm_gflops(self.args.threads),
            "ns_of_a_thread_a_sample": {
                p: sum(k["ns"] for name, k in self.report["kernels"].items() if name.startswith(p))
                for p in ("float32", "bfloat16")
                if f"{p}_density_forward" in self.report["kernels"]  # bfloat16: where the machine has tiles
            },
            "threads": self.args.threads,
        }

    def train(self, folder: str, *flags: Any) -> dict[str, Any]:
        return self.run("train", self.args.scene, "-o", Path(folder) / "f.safetensors", "--minutes", 1 / 3, *flags)

    def training(self) -> None:
        """Microseconds a fitted sample over the first 20 seconds, all included, in both precisions in turn."""
        each: dict[str, list[float]] = {"bfloat16": [], "float32": []}
        with tempfile.TemporaryDirectory() as folder:
            for _ in range(self.args.repeats):
                for precision, found in each.items():
                    done = self.train(folder, "--threads", self.args.threads, "--precision", precision)
                    found.append(done["seconds"] / done["samples"] * 1e6)
            config = self.config(Path(folder) / "f.safetensors")
        plain = eager.microseconds_a_sample(self.args.threads, config)
        self.report["training"] = {
            "config": config,
            "flops_a_sample": flops_a_sample(config),
            "gemm_float32": gemm_gflops(self.args.threads),
            "pytorch_eager_microseconds_a_sample": plain,
            "microseconds_a_sample": {p: spread(v) for p, v in each.items()},
        }

    def scaling(self) -> None:
        """Samples fitted a second with one thread and with all, in turn."""
        rates: dict[int, list[float]] = {1: [], self.args.threads: []}
        with tempfile.TemporaryDirectory() as folder:
            for _ in range(self.args.repeats):
                for threads, found in rates.items():
                    done = self.train(folder, "--threads", threads)
                    found.append(done["samples"] / done["seconds"])
        self.report["scaling"] = {f"samples_a_second_{t}": spread(v, 0) for t, v in rates.items()}

    def render(self) -> None:
        views = ["--scene", self.args.scene, "--split", "test", "--threads", self.args.threads]
        seconds = [self.run("eval", self.args.field, *views)["seconds_per_view"] for _ in range(self.args.repeats)]
        self.report["render"] = {"seconds_a_view": spread(seconds)}

    def edit(self) -> None:
        """S = 128, built-in guide: seconds an iteration, and of them f's and g's, of a recolouring and of all three.
        All thousand are run: the first hundred make the views that the others see again."""
        prompt = ["--source", "yellow bulldozer", "--target", "red bulldozer", "--scene", self.args.scene]
        self.report["edit"] = {}
        with tempfile.TemporaryDirectory() as folder:
            for operations in ("change", "add,remove,change"):
                size = ["--iterations", 1000, "--patch", 128, "--threads", self.args.threads]
                files = [self.args.field, "-o", Path(folder) / f"{operations}.safetensors"]
                runs = [self.run("edit", *files, "--ops", operations, *prompt, *size) for _ in range(self.args.repeats)]
                self.report["edit"][operations] = {
                    "seconds_an_iteration": spread([r["seconds_per_iteration"] for r in runs]),
                    "of_them_field_and_rendering": spread([r["field_seconds_per_iteration"] for r in runs]),
                }

    def towers(self) -> None:
        """An iteration with towers of ViT-B/32's size (random weights), 24 augmented pairs, beside the time their
        products alone would take at the machine's GEMM rate of the type they are computed in."""
        prompt = ["--source", "yellow bulldozer", "--target", "red bulldozer", "--ops", "change"]
        size = ["--patch", 128, "--augmentations", 24, "--iterations", 12, "--threads", self.args.threads]
        guide = ROOT / "models" / "guide"
        with tempfile.TemporaryDirectory() as folder:
            clip = random_clip.write_folder(Path(folder) / "clip", guide)
            files = [self.args.field, "-o", Path(folder) / "e.safetensors", "--guidance", clip, "--segmenter", guide]
            done = self.run("edit", *files, *prompt, *size)
        bfloat16 = random_clip.computed_in_bfloat16()
        gemm = gemm_gflops(self.args.threads, bfloat16=bfloat16)
        # The blended pictures forward and back to their pixels, the original ones forward.
        gflop = 3 * 24 * random_clip.GFLOP_AN_IMAGE
        self.report["towers"] = {
            "seconds_an_iteration": done["seconds_per_iteration"],
            "of_them_field_and_rendering": done["field_seconds_per_iteration"],
            "type": "bfloat16" if bfloat16 else "float32",
            "gflop_an_iteration": round(gflop),
            "gemm": gemm,
            "products_alone_seconds": round(gflop / gemm["median"], 3),
        }

    def images(self) -> None:
        """2,000 images of 1920×1080: memory, and a step's time beside that of the images that fit into memory."""
        self.report["images"] = {}
        with tempfile.TemporaryDirectory() as folder:
            for count in (200, 2000):
                scene = many_images.write_scene(Path(folder) / str(count), count)
                done = self.run(
                    "train", scene, "-o", Path(folder) / "f.safetensors", "--minutes", 1, "--threads", self.args.threads
                )
                self.report["images"][str(count)] = {
                    "peak_mib": round(done["peak_mib"]),
                    "seconds_an_iteration": round(done["seconds"] / done["iterations"], 4),
                    "psnr": round(done["psnr"], 2),
                }

    def peer(self) -> None:
        """Seconds of training to 28 dB: whole runs of ours, each a tenth longer, until the test views reach it; then
        nerfstudio's for 26 times as long."""
        psnr, seconds, found = 28.0, 8.0, 0.0
        curve = []
        with tempfile.TemporaryDirectory() as folder:
            field = Path(folder) / "f.safetensors"
            while found < psnr:
                seconds *= 1.1
                time = ["--minutes", seconds / 60, "--threads", self.args.threads]
                spent = self.run("train", self.args.scene, "-o", field, *time)["seconds"]
                found = self.run("eval", field, "--scene", self.args.scene, "--split", "test")["psnr"]
                curve.append({"seconds": round(spent, 1), "psnr": round(found, 2)})
        script = [self.args.peer_python, ROOT / "bench" / "peer_nerfstudio.py", "--scene", self.args.scene]
        script += ["--psnr", psnr, "--seconds", 26 * curve[-1]["seconds"]]
        done = subprocess.run([str(c) for c in script], stdout=subprocess.PIPE, check=True)
        self.report["peer"] = {"psnr": psnr, "ours": curve, "nerfstudio": json.loads(done.stdout)}

    def growth(self) -> None:
        """Time and memory against what a user can turn up."""
        args = self.args
        self.report["growth"] = Growth(args.program, args.scene, args.field, args.edit, args.threads).measure()

    def bake(self) -> None:
        files = [self.args.field] + ([self.args.edit] if self.args.edit else [])
        with tempfile.TemporaryDirectory() as folder:
            grid = ["-o", Path(folder) / "grid.vdb", "--resolution", 256, "--threads", self.args.threads]
            done = [self.run("bake", *files, *grid) for _ in range(self.args.repeats)]
        self.report["bake"] = {
            "with_edit": self.args.edit is not None,
            "seconds": spread([d["seconds"] for d in done]),
            "voxels": done[-1]["voxels"],
            "bytes": done[-1]["bytes"],
        }


def measure_all(args: Any) -> None:
    performance = Performance(args)
    report, wanted = performance.report, args.only.split(",")
    # A part that is measured again elsewhere says so; the page's machine stays that of the rest.
    measured_on = report.setdefault("measured_on", {})
    if {p for n, p in measured_on.items() if n not in wanted} <= {results_page.processor()}:
        performance.machine()
    for name in wanted:
        getattr(performance, name)()
        measured_on[name] = results_page.processor()
        performance.save()
        print(json.dumps({name: performance.report[name]}), file=sys.stderr, flush=True)
    results_page.main()
