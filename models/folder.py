"""Reading and writing a guidance folder: config.json, model.safetensors (float16), vocabulary, merges, known words."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import torch
from network import Guidance
from safetensors.torch import load_file, save_file
from tokenizer import CaptionTokenizer, write_text
from torch import Tensor

MAX_BYTES = 25_000_000


def save_folder(
    folder: Path, config: dict[str, Any], state: dict[str, Tensor], tokenizer: CaptionTokenizer, card: str | None = None
) -> int:
    """Writes every file through a temporary name and returns the weights' size in bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    tensors = {}
    for name, value in state.items():
        if name.endswith("num_batches_tracked"):
            continue
        half = value.detach().cpu().to(torch.float16)
        if not torch.isfinite(half).all():
            raise ValueError(f"{name}: has values beyond float16 (largest {float(value.abs().max()):.3g})")
        tensors[name] = half.contiguous()
    target, part = folder / "model.safetensors", folder / "model.safetensors.part"
    save_file(tensors, part, metadata={"format": "pt"})
    size = part.stat().st_size
    if size > MAX_BYTES:
        part.unlink()
        raise ValueError(f"{target}: {size} bytes, the limit is {MAX_BYTES}")
    part.chmod(0o644)  # save_file leaves it to its owner alone
    os.replace(part, target)
    write_text(folder / "config.json", json.dumps(config, indent=1) + "\n")
    tokenizer.save(folder)
    if card is not None:
        write_text(folder / "README.md", card)
    return size


def load_folder(folder: Path) -> tuple[Guidance, CaptionTokenizer]:
    """The model in evaluation mode (float32) and its tokenizer."""
    config = json.loads((folder / "config.json").read_text(encoding="utf-8"))
    model = Guidance(config)
    state = {k: v.float() for k, v in load_file(folder / "model.safetensors").items()}
    missing, unexpected = model.load_state_dict(state, strict=False)
    missing = [m for m in missing if not m.endswith("num_batches_tracked")]
    if missing or unexpected:
        raise ValueError(f"{folder}/model.safetensors: lacks {missing[:3]}, does not know {unexpected[:3]}")
    tokenizer = CaptionTokenizer.load(folder, config["text_config"]["max_position_embeddings"])
    return model.to(memory_format=torch.channels_last).eval(), tokenizer


def mean_weights(first: dict[str, Tensor], second: dict[str, Tensor]) -> dict[str, Tensor]:
    """The mean of two sets of weights of one network, of which one was trained on from the other; counters as in the
    first."""
    if first.keys() != second.keys() or any(first[k].shape != second[k].shape for k in first):
        raise ValueError("the mean of weights needs two sets of one network's")
    return {k: (v.float() + second[k].float()) / 2 if v.is_floating_point() else v for k, v in first.items()}
