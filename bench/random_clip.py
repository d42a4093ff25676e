"""A guidance folder of CLIP ViT-B/32's size with random weights: what the real towers would cost."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

LAYERS, WIDTH, PATCHES, PATCH_VALUES = 12, 768, 49, 3 * 32 * 32

# Products of an image's way forward: 12 w² a token and layer for the matrices, 2 w a pair of tokens for attention, and
# the embedding of the patches; two operations each.
TOKENS = PATCHES + 1
GFLOP_AN_IMAGE = 2 * (LAYERS * (TOKENS * 12 * WIDTH**2 + 2 * TOKENS**2 * WIDTH) + PATCHES * PATCH_VALUES * WIDTH) / 1e9


def computed_in_bfloat16() -> bool:
    """As the program decides: where the processor has AVX-512-BF16 or AMX."""
    flags = Path("/proc/cpuinfo").read_text().split("flags", 1)[-1].split("\n", 1)[0].split()
    return "avx512_bf16" in flags or "amx_bf16" in flags


def write_folder(folder: Path, vocabulary: Path) -> Path:
    """The folder, with the tokenizer of another guidance folder."""
    import torch
    from transformers import CLIPConfig, CLIPModel

    words = json.loads((vocabulary / "vocab.json").read_text())
    config = CLIPConfig()
    config.text_config.vocab_size = len(words)
    for name, token in (("bos_token_id", "<|startoftext|>"), ("eos_token_id", "<|endoftext|>")):
        setattr(config.text_config, name, words[token])
    torch.manual_seed(0)
    CLIPModel(config).save_pretrained(folder)
    for name in ("vocab.json", "merges.txt"):
        shutil.copyfile(vocabulary / name, folder / name)
    return folder
