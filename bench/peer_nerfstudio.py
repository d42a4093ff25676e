"""How long nerfstudio's own CPU path takes to a PSNR on a NeRF-synthetic scene; bench/peers.py runs it beside ours.

    PEER_PYTHON bench/peer_nerfstudio.py --scene DIR --psnr 28 --seconds 600 [--views 2]

For an environment of its own: nerfstudio 1.1.5 and torch 2.13.0. The method is nerfacto with implementation="torch" and
the settings that nerfstudio's pages give for these scenes: white background, uniform first samples between 2 and 6, no
contraction, no camera optimiser, no appearance embedding, no distortion loss. Trained by nerfstudio's Trainer, one
iteration after the other; after every quarter of the seconds allowed some test views are drawn, which does not count.
One JSON object: PSNR against seconds, and the first seconds at which the PSNR was reached, if it was.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import torch

# A torchvision whose compiled part does not fit this torch wants these operators to exist; nothing here calls them.
for operator in ("nms", "qnms"):
    with contextlib.suppress(RuntimeError):
        torch.library.define(f"torchvision::{operator}", "(Tensor dets, Tensor scores, float threshold) -> Tensor")

# ruff: noqa: E402
from nerfstudio.configs.method_configs import method_configs
from nerfstudio.data.datamanagers.base_datamanager import VanillaDataManagerConfig
from nerfstudio.data.dataparsers.blender_dataparser import BlenderDataParserConfig
from nerfstudio.engine.callbacks import TrainingCallbackLocation
from torchmetrics.image import lpip

# Its weights would be downloaded; it is a measure that is not taken here.
lpip.LearnedPerceptualImagePatchSimilarity = lambda **_: torch.nn.Identity()


def make_trainer(scene: Path, folder: Path) -> Any:
    config = method_configs["nerfacto"]
    config.machine.device_type = "cpu"
    config.vis = "tensorboard"
    config.output_dir, config.timestamp, config.experiment_name = folder, "run", "peer"
    config.pipeline.datamanager = VanillaDataManagerConfig(
        dataparser=BlenderDataParserConfig(data=scene), train_num_rays_per_batch=4096
    )
    model = config.pipeline.model
    model.implementation = "torch"
    model.eval_num_rays_per_chunk = 4096  # the usual 32,768 want more memory at once than a processor is fast at
    model.background_color = "white"
    model.proposal_initial_sampler = "uniform"
    model.near_plane, model.far_plane = 2.0, 6.0
    model.use_average_appearance_embedding = False
    model.use_appearance_embedding = False
    model.distortion_loss_mult = 0.0
    model.disable_scene_contraction = True
    model.camera_optimizer.mode = "off"
    trainer = config.setup(local_rank=0, world_size=1)
    trainer.setup(test_mode="test")
    return trainer


def iterate(trainer: Any, step: int) -> None:
    trainer.pipeline.train()
    for callback in trainer.callbacks:
        callback.run_callback_at_location(step, location=TrainingCallbackLocation.BEFORE_TRAIN_ITERATION)
    trainer.train_iteration(step)
    for callback in trainer.callbacks:
        callback.run_callback_at_location(step, location=TrainingCallbackLocation.AFTER_TRAIN_ITERATION)


@torch.no_grad()
def test_psnr(trainer: Any, views: int) -> float:
    trainer.pipeline.eval()
    data = trainer.pipeline.datamanager.eval_dataset
    total = 0.0
    for k in range(views):
        i = k * len(data) // views
        drawn = trainer.pipeline.model.get_outputs_for_camera(data.cameras[i : i + 1])["rgb"].clamp(0, 1)
        total += float(-10 * torch.log10((drawn - data[i]["image"][..., :3]).square().mean()))
    return total / views


def measure(scene: Path, psnr: float, seconds: float, views: int) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        trainer = make_trainer(scene, Path(folder))
        curve: list[dict[str, float]] = []
        spent, step, told = 0.0, 0, 0.0
        while spent < seconds:
            start = time.perf_counter()
            iterate(trainer, step)
            spent += time.perf_counter() - start
            step += 1
            if spent - told < seconds / 4 and spent < seconds:
                continue
            told = spent
            curve.append({"seconds": round(spent, 1), "iterations": step, "psnr": round(test_psnr(trainer, views), 2)})
            print(json.dumps(curve[-1]), file=sys.stderr, flush=True)
            if curve[-1]["psnr"] >= psnr:
                break
    reached = next((point["seconds"] for point in curve if point["psnr"] >= psnr), None)
    return {"method": "nerfacto, implementation=torch", "views": views, "curve": curve, "seconds_to_psnr": reached}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scene", type=Path, required=True)
    parser.add_argument("--psnr", type=float, default=28.0)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--views", type=int, default=2)
    args = parser.parse_args()
    with contextlib.redirect_stdout(sys.stderr):
        figures = measure(args.scene, args.psnr, args.seconds, args.views)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
