"""Reference models for the guidance tests: random weights in transformers and in plain PyTorch, written as folders."""

import json
from pathlib import Path

import numpy as np
import torch
import transformers
from torch.nn import functional

TOLERANCE = 1e-4
CLIP_MEAN, CLIP_STD = (0.48145466, 0.4578275, 0.40821073), (0.26862954, 0.26130258, 0.27577711)
IMAGENET_MEAN, IMAGENET_STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
TEXTS = ["red ball", "a photo of a red ball", "", "ball ball ball ball ball ball ball ball ball ball ball"]


def byte_characters() -> list[str]:
    """The printable stand-ins of the 256 bytes, in the order in which CLIP numbers them."""
    printable = [*range(33, 127), *range(161, 173), *range(174, 256)]
    hidden = [b for b in range(256) if b not in printable]
    return [chr(b) for b in printable] + [chr(256 + i) for i in range(len(hidden))]


def write_vocabulary(folder: Path, merges: list[str]) -> dict[str, int]:
    tokens = byte_characters()
    tokens += [token + "</w>" for token in tokens]
    tokens += [merge.replace(" ", "") for merge in merges]
    tokens += ["<|startoftext|>", "<|endoftext|>"]
    vocabulary = {token: i for i, token in enumerate(tokens)}
    (folder / "vocab.json").write_text(json.dumps(vocabulary))
    (folder / "merges.txt").write_text("#version: 0.2\n" + "\n".join(merges) + "\n", encoding="utf-8")
    return vocabulary


def small_vocabulary(folder: Path) -> dict[str, int]:
    return write_vocabulary(folder, ["r e", "re d</w>", "b a", "ba l", "bal l</w>"])


def reference_tokenizer(folder: Path) -> transformers.CLIPTokenizer:
    merges = [tuple(line.split(" ")) for line in (folder / "merges.txt").read_text("utf-8").split("\n")[1:] if line]
    return transformers.CLIPTokenizer(vocab=json.loads((folder / "vocab.json").read_text("utf-8")), merges=merges)


def random_images(count: int, size: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).random((count, size, size, 3), dtype=np.float32)


def to_pixels(images: np.ndarray, mean: tuple[float, ...], std: tuple[float, ...]) -> torch.Tensor:
    return ((torch.from_numpy(images) - torch.tensor(mean)) / torch.tensor(std)).permute(0, 3, 1, 2)


def assert_close(got: np.ndarray, expected: torch.Tensor, tolerance: float = TOLERANCE) -> None:
    expected = expected.detach().numpy()
    assert got.shape == expected.shape
    assert np.abs(expected).max() > 0.01, "the reference must not be trivially zero"
    assert np.abs(got - expected).max() <= tolerance, np.abs(got - expected).max()


def tiny_text(vocabulary: dict[str, int], **changes: object) -> dict[str, object]:
    return {
        "hidden_size": 32,
        "intermediate_size": 48,
        "num_attention_heads": 4,
        "num_hidden_layers": 3,
        "vocab_size": len(vocabulary),
        "max_position_embeddings": 20,
        "projection_dim": 24,
        "bos_token_id": vocabulary["<|startoftext|>"],
        "eos_token_id": vocabulary["<|endoftext|>"],
        "pad_token_id": vocabulary["<|endoftext|>"],
        **changes,
    }


def tiny_vision(**changes: object) -> dict[str, object]:
    return {
        "hidden_size": 40,
        "intermediate_size": 56,
        "num_attention_heads": 5,
        "num_hidden_layers": 4,
        "image_size": 32,
        "patch_size": 8,
        "projection_dim": 24,
        **changes,
    }


def randomise(model: torch.nn.Module, seed: int = 0) -> None:
    """Weights large enough that every part matters (fresh models have zero biases and tiny weights)."""
    torch.manual_seed(seed)
    with torch.no_grad():
        for name, parameter in model.named_parameters():
            if "norm" in name and name.endswith("weight"):
                parameter.copy_(1 + 0.2 * torch.randn_like(parameter))
            elif parameter.dim() > 1:
                fan_in = parameter[0].numel()
                parameter.copy_(torch.randn_like(parameter) / fan_in**0.5)
            elif name != "logit_scale":
                parameter.copy_(0.2 * torch.randn_like(parameter))


def reference_ids(folder: Path, texts: list[str], length: int) -> torch.Tensor:
    tokens = reference_tokenizer(folder)(texts, truncation=True, max_length=length, padding="max_length")
    return torch.tensor(tokens["input_ids"])


def clip_text(model: torch.nn.Module, ids: torch.Tensor) -> torch.Tensor:
    return model.text_projection(model.text_model(input_ids=ids).pooler_output)


def clip_image(model: torch.nn.Module, pixels: torch.Tensor) -> torch.Tensor:
    return model.visual_projection(model.vision_model(pixel_values=pixels).pooler_output)


class BuiltIn:
    """A plain PyTorch rendering of the built-in layout: modified ResNet with attention pooling, FiLM pyramid."""

    def __init__(self, folder: Path, stem_pool: bool, conditional: int, seed: int = 0) -> None:
        self.generator = torch.Generator().manual_seed(seed)
        self.tensors: dict[str, torch.Tensor] = {}
        self.stem_pool, self.conditional, self.width, self.heads = stem_pool, conditional, 6, 8
        self.layers, self.stages, self.reduce, self.dimension, self.size = [1, 2, 1, 2], [0, 1, 3, 4], 7, 24, 64
        self.make_trunk()
        self.make_decoder()
        self.write(folder)

    def add(self, name: str, *shape: int) -> None:
        fan_in = int(np.prod(shape[1:])) if len(shape) > 1 else 25
        self.tensors[name] = torch.randn(shape, generator=self.generator) * (1.5 / fan_in) ** 0.5

    def add_conv_norm(self, conv: str, norm: str, fan_in: int, out: int, kernel: int) -> None:
        self.add(conv + ".weight", out, fan_in, kernel, kernel)
        for name in ("bias", "running_mean"):
            self.add(f"{norm}.{name}", out)
        self.tensors[norm + ".weight"] = 1 + 0.1 * torch.randn(out, generator=self.generator)
        self.tensors[norm + ".running_var"] = 0.5 + torch.rand(out, generator=self.generator)

    def make_trunk(self) -> None:
        width = self.width
        for i, (fan_in, out) in enumerate([(3, width // 2), (width // 2, width // 2), (width // 2, width)], 1):
            self.add_conv_norm(f"visual.conv{i}", f"visual.bn{i}", fan_in, out, 3)
        fan_in = width
        for stage, count in enumerate(self.layers, 1):
            planes = width * 2 ** (stage - 1)
            for block in range(count):
                name = f"visual.layer{stage}.{block}."
                self.add_conv_norm(name + "conv1", name + "bn1", fan_in, planes, 1)
                self.add_conv_norm(name + "conv2", name + "bn2", planes, planes, 3)
                self.add_conv_norm(name + "conv3", name + "bn3", planes, planes * 4, 1)
                if block == 0:
                    self.add_conv_norm(name + "downsample.0", name + "downsample.1", fan_in, planes * 4, 1)
                fan_in = planes * 4
        side = self.size // (32 if self.stem_pool else 16)
        self.add("visual.attnpool.positional_embedding", side * side + 1, fan_in)
        for part, out in (("q", fan_in), ("k", fan_in), ("v", fan_in), ("c", self.dimension)):
            self.add(f"visual.attnpool.{part}_proj.weight", out, fan_in)
            self.add(f"visual.attnpool.{part}_proj.bias", out)

    def make_decoder(self) -> None:
        channels = [self.width, *(self.width * 4 * 2**i for i in range(4))]
        for stage in self.stages:
            self.add(f"decoder.reduces.{stage}.weight", self.reduce, channels[stage], 1, 1)
            self.add(f"decoder.reduces.{stage}.bias", self.reduce)
            for conv in ("conv1", "conv2"):
                self.add(f"decoder.blocks.{stage}.{conv}.weight", self.reduce, self.reduce, 3, 3)
                self.add(f"decoder.blocks.{stage}.{conv}.bias", self.reduce)
            if self.conditional in (-1, stage):
                for film in ("film_mul", "film_add"):
                    name = f"decoder.{film}" + (f".{stage}" if self.conditional < 0 else "")
                    self.add(name + ".weight", self.reduce, self.dimension)
                    self.add(name + ".bias", self.reduce)
        self.add("decoder.head.weight", 1, self.reduce, 3, 3)
        self.add("decoder.head.bias", 1)

    def write(self, folder: Path) -> None:
        from safetensors.torch import save_file

        vocabulary = small_vocabulary(folder)
        self.text_config = tiny_text(vocabulary)
        self.text = transformers.CLIPTextModelWithProjection(transformers.CLIPTextConfig(**self.text_config)).eval()
        randomise(self.text)
        text = {
            name: value.contiguous() for name, value in self.text.state_dict().items() if "position_ids" not in name
        }
        text = {n if n.startswith("text_") else "text_model." + n: v for n, v in text.items()}
        save_file({**self.tensors, **text, "logit_scale": torch.tensor(2.0)}, folder / "model.safetensors")
        config = {
            "model_type": "fieldgraft-guidance",
            "projection_dim": self.dimension,
            "text_config": {**self.text_config, "hidden_act": "quick_gelu"},
            "vision_config": {
                "trunk": "modified_resnet",
                "image_size": self.size,
                "width": self.width,
                "layers": self.layers,
                "stem_pool": self.stem_pool,
                "num_attention_heads": self.heads,
            },
            "segmenter_config": {
                "type": "film_pyramid",
                "stages": self.stages,
                "reduce_dim": self.reduce,
                "conditional_stage": self.conditional,
                "logit_stride": 2,
            },
            "preprocess": {"image_size": self.size, "image_mean": CLIP_MEAN, "image_std": CLIP_STD},
            "templates": ["{}", "a photo of {}"],
        }
        (folder / "config.json").write_text(json.dumps(config))

    def conv_norm(self, x: torch.Tensor, conv: str, norm: str, stride: int = 1) -> torch.Tensor:
        get = self.tensors.__getitem__
        weight = get(conv + ".weight")
        x = functional.conv2d(x, weight, stride=stride, padding=weight.shape[-1] // 2)
        mean, var = get(norm + ".running_mean"), get(norm + ".running_var")
        return functional.batch_norm(x, mean, var, get(norm + ".weight"), get(norm + ".bias"), eps=1e-5)

    def trunk(self, x: torch.Tensor) -> list[torch.Tensor]:
        for i in (1, 2, 3):
            x = torch.relu(self.conv_norm(x, f"visual.conv{i}", f"visual.bn{i}", stride=2 if i == 1 else 1))
        stages = [x]
        if self.stem_pool:
            x = functional.avg_pool2d(x, 2)
        for stage, count in enumerate(self.layers, 1):
            for block in range(count):
                name, stride = f"visual.layer{stage}.{block}.", 2 if stage > 1 and block == 0 else 1
                y = torch.relu(self.conv_norm(x, name + "conv1", name + "bn1"))
                y = torch.relu(self.conv_norm(y, name + "conv2", name + "bn2"))
                y = self.conv_norm(functional.avg_pool2d(y, stride), name + "conv3", name + "bn3")
                if block == 0:
                    x = self.conv_norm(functional.avg_pool2d(x, stride), name + "downsample.0", name + "downsample.1")
                x = torch.relu(x + y)
            stages.append(x)
        return stages

    def embed(self, pixels: torch.Tensor) -> torch.Tensor:
        x = self.trunk(pixels)[-1].flatten(2).permute(2, 0, 1)  # HW, N, C
        x = torch.cat([x.mean(0, keepdim=True), x]) + self.tensors["visual.attnpool.positional_embedding"][:, None]
        get = {k.split("attnpool.")[1]: v for k, v in self.tensors.items() if "attnpool" in k}
        out, _ = functional.multi_head_attention_forward(
            x[:1],
            x,
            x,
            x.shape[-1],
            self.heads,
            None,
            torch.cat([get[f"{p}_proj.bias"] for p in "qkv"]),
            None,
            None,
            False,
            0.0,
            get["c_proj.weight"],
            get["c_proj.bias"],
            training=False,
            need_weights=False,
            use_separate_proj_weight=True,
            q_proj_weight=get["q_proj.weight"],
            k_proj_weight=get["k_proj.weight"],
            v_proj_weight=get["v_proj.weight"],
        )
        return out[0]

    def conv(self, x: torch.Tensor, name: str) -> torch.Tensor:
        weight = self.tensors[name + ".weight"]
        return functional.conv2d(x, weight, self.tensors[name + ".bias"], padding=weight.shape[-1] // 2)

    def segment(self, pixels: torch.Tensor, text: torch.Tensor) -> torch.Tensor:
        stages, c, a = self.trunk(pixels), functional.normalize(text), None
        for stage in reversed(self.stages):
            x = self.conv(stages[stage], f"decoder.reduces.{stage}")
            a = x if a is None else x + functional.interpolate(a, x.shape[2:], mode="bilinear", align_corners=False)
            if self.conditional in (-1, stage):
                suffix = f".{stage}" if self.conditional < 0 else ""
                mul, add = (
                    functional.linear(
                        c, self.tensors[f"decoder.{film}{suffix}.weight"], self.tensors[f"decoder.{film}{suffix}.bias"]
                    )
                    for film in ("film_mul", "film_add")
                )
                a = mul[:, :, None, None] * a + add[:, :, None, None]
            r = torch.relu(self.conv(a, f"decoder.blocks.{stage}.conv1"))
            a = torch.relu(a + self.conv(r, f"decoder.blocks.{stage}.conv2"))
        logits = self.conv(a, "decoder.head")
        return functional.interpolate(logits, pixels.shape[2:], mode="bilinear", align_corners=False)[:, 0]
