"""How time and memory grow: training with samples an iteration, table and width; drawing and baking with resolution."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from run import done_event

TRAINING_SECONDS = 10
SAMPLES = [1 << n for n in (12, 13, 14, 15, 16, 17)]
TABLES = [14, 16, 18, 20]
WIDTHS = [16, 32, 64, 128]
SCALES = [0.5, 1, 2, 4]
VOXELS = [128, 256, 512]


class Growth:
    def __init__(self, program: Path, scene: Path, field: Path, edit: Path | None, threads: int) -> None:
        self.program, self.scene, self.field, self.threads = program, scene, field, threads
        self.files = [field] + ([edit] if edit else [])

    def training(self, folder: str, flag: str, value: int) -> dict[str, Any]:
        minutes = TRAINING_SECONDS / 60
        command = [self.program, "train", self.scene, "-o", Path(folder) / "f.safetensors", "--minutes", minutes]
        done = done_event([*command, flag, value, "--threads", self.threads])
        iteration, sample = done["seconds"] / done["iterations"], done["seconds"] / done["samples"]
        size = (Path(folder) / "f.safetensors").stat().st_size / 2**20
        figures = {"ms_an_iteration": 1e3 * iteration, "microseconds_a_sample": 1e6 * sample, "file_mib": size}
        return {"value": value, **{k: round(v, 2) for k, v in figures.items()}, "peak_mib": round(done["peak_mib"])}

    def drawing(self, folder: str, scale: float) -> dict[str, Any]:
        command = [self.program, "render", self.field, "--scene", self.scene, "--split", "test", "--views", "r_0"]
        done = done_event([*command, "--scale", scale, "-o", folder, "--threads", self.threads])
        return {"value": scale, "seconds": round(done["seconds"], 3), "peak_mib": round(done["peak_mib"])}

    def baking(self, folder: str, voxels: int) -> dict[str, Any]:
        grid = Path(folder) / "grid.vdb"
        command = [self.program, "bake", *self.files, "-o", grid, "--resolution", voxels, "--threads", self.threads]
        done = done_event(command)
        figures = {"seconds": round(done["seconds"], 2), "file_mib": round(done["bytes"] / 2**20, 1)}
        return {"value": voxels, **figures, "peak_mib": round(done["peak_mib"])}

    def measure(self) -> dict[str, list[dict[str, Any]]]:
        with tempfile.TemporaryDirectory() as folder:
            return {
                "samples": [self.training(folder, "--samples", n) for n in SAMPLES],
                "table": [self.training(folder, "--table", n) for n in TABLES],
                "width": [self.training(folder, "--width", n) for n in WIDTHS],
                "drawing": [self.drawing(folder, s) for s in SCALES],
                "baking": [self.baking(folder, n) for n in VOXELS],
            }
