"""The built-in guidance networks: CLIP's text tower, CLIP's modified ResNet, and a FiLM pyramid segmenter.

Parameter names are the ones the C++ room `core/guidance` reads, so a state_dict is the weights file:
* text: Hugging Face's CLIPTextModelWithProjection (`text_model.*`, `text_projection.weight`, `logit_scale`),
  causal, quick GELU, the feature taken at the end-of-text token (Radford et al. 2021, sec. 2.4);
* image: OpenAI CLIP's ModifiedResNet under `visual.*` (stem of three convolutions, averaged strides, attention pool);
* segmenter: CLIPSeg's idea (Lueddecke and Ecker 2022: trunk activations, text-conditioned FiLM, small decoder) with
  convolutions, under `decoder.*`.

Pictures enter as RGB in [0, 1], N x 3 x S x S; `Guidance.preprocess` subtracts the mean and divides by the deviation.
Embeddings are N x D and not normalised; `unit` normalises them. Segmentation logits are N x S x S.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F

CONTEXT_LENGTH = 32


def default_config(
    width: int = 32,
    layers: tuple[int, ...] = (1, 1, 1, 1),
    dim: int = 256,
    text_width: int = 128,
    text_layers: int = 3,
    reduce_dim: int = 48,
    stages: tuple[int, ...] = (1, 2, 3, 4),
    stem_pool: bool = False,
    vocab_size: int = 0,
) -> dict[str, Any]:
    """The folder's config.json; `vocab_size` and the token ids are filled in when the tokenizer is known."""
    return {
        "model_type": "fieldgraft-guidance",
        "projection_dim": dim,
        "logit_scale_init_value": 2.6592,
        "text_config": {
            "hidden_size": text_width,
            "intermediate_size": 4 * text_width,
            "num_attention_heads": text_width // 32,
            "num_hidden_layers": text_layers,
            "max_position_embeddings": CONTEXT_LENGTH,
            "vocab_size": vocab_size,
            "hidden_act": "quick_gelu",
            "layer_norm_eps": 1e-5,
            "bos_token_id": vocab_size - 2,
            "eos_token_id": vocab_size - 1,
        },
        "vision_config": {
            "trunk": "modified_resnet",
            "image_size": 64,
            "width": width,
            "layers": list(layers),
            "stem_pool": stem_pool,
            "num_attention_heads": max(1, width // 4),
        },
        "segmenter_config": {
            "type": "film_pyramid",
            "stages": list(stages),
            "reduce_dim": reduce_dim,
            "conditional_stage": -1,
            "logit_stride": (2 if 0 in stages or not stem_pool else 4),
        },
        "preprocess": {"image_size": 64, "image_mean": [0.65, 0.64, 0.62], "image_std": [0.3, 0.3, 0.3]},
        "augmentation": {"brightness": 0.15, "contrast": 0.3, "saturation": 0.3},
        "templates": ["{}", "a photo of {}", "a picture of {}", "an image of {}", "a rendering of {}"],
    }


def unit(x: Tensor, softness: float = 0.0) -> Tensor:
    """x over its length; `softness` is added in quadrature so that a vanishing vector keeps a finite gradient."""
    x = x.float()
    return x / torch.sqrt((x * x).sum(-1, keepdim=True) + max(softness * softness, 1e-12))


class TextAttention(nn.Module):
    """Multi-head attention with Hugging Face's names; plain products are faster than the fused kernel here."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.q_proj, self.k_proj = nn.Linear(width, width), nn.Linear(width, width)
        self.v_proj, self.out_proj = nn.Linear(width, width), nn.Linear(width, width)

    def forward(self, x: Tensor, mask: Tensor) -> Tensor:
        n, length, width = x.shape
        projections = (self.q_proj, self.k_proj, self.v_proj)
        q, k, v = (p(x).view(n, length, self.heads, -1).transpose(1, 2) for p in projections)
        scores = q @ k.transpose(-1, -2) * (width // self.heads) ** -0.5 + mask
        out = scores.softmax(-1).to(v.dtype) @ v
        return self.out_proj(out.transpose(1, 2).reshape(n, length, width))


class TextMlp(nn.Module):
    def __init__(self, width: int, inner: int) -> None:
        super().__init__()
        self.fc1, self.fc2 = nn.Linear(width, inner), nn.Linear(inner, width)

    def forward(self, x: Tensor) -> Tensor:
        x = self.fc1(x)
        return self.fc2(x * torch.sigmoid(1.702 * x))


class TextLayer(nn.Module):
    def __init__(self, c: dict[str, Any]) -> None:
        super().__init__()
        width = c["hidden_size"]
        self.layer_norm1, self.layer_norm2 = (nn.LayerNorm(width, c["layer_norm_eps"]) for _ in range(2))
        self.self_attn = TextAttention(width, c["num_attention_heads"])
        self.mlp = TextMlp(width, c["intermediate_size"])

    def forward(self, x: Tensor, mask: Tensor) -> Tensor:
        x = x + self.self_attn(self.layer_norm1(x), mask)
        return x + self.mlp(self.layer_norm2(x))


class TextEmbeddings(nn.Module):
    def __init__(self, c: dict[str, Any]) -> None:
        super().__init__()
        self.token_embedding = nn.Embedding(c["vocab_size"], c["hidden_size"])
        self.position_embedding = nn.Embedding(c["max_position_embeddings"], c["hidden_size"])
        nn.init.normal_(self.token_embedding.weight, std=0.02)
        nn.init.normal_(self.position_embedding.weight, std=0.01)

    def forward(self, ids: Tensor) -> Tensor:
        return self.token_embedding(ids) + self.position_embedding.weight[: ids.shape[1]]


class TextEncoder(nn.Module):
    def __init__(self, c: dict[str, Any]) -> None:
        super().__init__()
        self.layers = nn.ModuleList(TextLayer(c) for _ in range(c["num_hidden_layers"]))


class TextModel(nn.Module):
    def __init__(self, c: dict[str, Any]) -> None:
        super().__init__()
        self.eos = c["eos_token_id"]
        self.embeddings = TextEmbeddings(c)
        self.encoder = TextEncoder(c)
        self.final_layer_norm = nn.LayerNorm(c["hidden_size"], c["layer_norm_eps"])

    def forward(self, ids: Tensor) -> Tensor:
        x = self.embeddings(ids)
        length = ids.shape[1]
        mask = torch.full((length, length), float("-inf"), device=ids.device).triu(1)
        for layer in self.encoder.layers:
            x = layer(x, mask)
        end = (ids == self.eos).int().argmax(-1)  # the first end-of-text token
        return self.final_layer_norm(x)[torch.arange(len(ids), device=ids.device), end]


class PointConv(nn.Conv2d):
    """A 1x1 convolution as a matrix product over channels-last pixels: faster on CPUs, backward above all."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__(inputs, outputs, 1, bias=False)

    def forward(self, x: Tensor) -> Tensor:
        n, c, h, w = x.shape
        y = F.linear(x.permute(0, 2, 3, 1).reshape(-1, c), self.weight.view(self.out_channels, c))
        return y.view(n, h, w, -1).permute(0, 3, 1, 2)


class GatheredConv(nn.Conv2d):
    """A 3x3 convolution as one matrix product over gathered neighbourhoods: faster for many channels on few pixels."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__(inputs, outputs, 3, padding=1, bias=False)

    def forward(self, x: Tensor) -> Tensor:
        n, c, h, w = x.shape
        padded = F.pad(x.permute(0, 2, 3, 1), (0, 0, 1, 1, 1, 1))
        near = torch.cat([padded[:, i : i + h, j : j + w] for i in range(3) for j in range(3)], -1)
        weight = self.weight.permute(0, 2, 3, 1).reshape(self.out_channels, -1)
        return F.linear(near.view(n * h * w, -1), weight).view(n, h, w, -1).permute(0, 3, 1, 2)


class Bottleneck(nn.Module):
    """CLIP's residual block: strides are average pools, before conv3 and before the shortcut's 1x1 convolution."""

    def __init__(self, inputs: int, planes: int, stride: int) -> None:
        super().__init__()
        many = planes >= 256
        middle = GatheredConv(planes, planes) if many else nn.Conv2d(planes, planes, 3, padding=1, bias=False)
        self.conv1, self.bn1 = PointConv(inputs, planes), nn.BatchNorm2d(planes)
        self.conv2, self.bn2 = middle, nn.BatchNorm2d(planes)
        self.conv3, self.bn3 = PointConv(planes, planes * 4), nn.BatchNorm2d(planes * 4)
        self.stride = stride
        self.downsample = None
        if stride > 1 or inputs != planes * 4:
            self.downsample = nn.Sequential(PointConv(inputs, planes * 4), nn.BatchNorm2d(planes * 4))

    def forward(self, x: Tensor) -> Tensor:
        y = F.relu(self.bn1(self.conv1(x)), inplace=True)
        y = F.relu(self.bn2(self.conv2(y)), inplace=True)
        if self.stride > 1:
            y, x = F.avg_pool2d(y, self.stride), F.avg_pool2d(x, self.stride)
        y = self.bn3(self.conv3(y))
        return F.relu(y + (x if self.downsample is None else self.downsample(x)), inplace=True)


class AttentionPool(nn.Module):
    """The mean token asks all positions once (CLIP sec. 2.4); output N x D."""

    def __init__(self, positions: int, width: int, heads: int, out: int) -> None:
        super().__init__()
        self.heads = heads
        self.positional_embedding = nn.Parameter(torch.randn(positions + 1, width) * width**-0.5)
        self.q_proj, self.k_proj = nn.Linear(width, width), nn.Linear(width, width)
        self.v_proj, self.c_proj = nn.Linear(width, width), nn.Linear(width, out)
        for p in (self.q_proj, self.k_proj, self.v_proj, self.c_proj):
            nn.init.normal_(p.weight, std=width**-0.5)

    def forward(self, x: Tensor) -> Tensor:
        n, width = x.shape[:2]
        x = x.flatten(2).transpose(1, 2)
        x = torch.cat([x.mean(1, keepdim=True), x], 1) + self.positional_embedding.to(x.dtype)
        q = self.q_proj(x[:, :1]).view(n, 1, self.heads, -1).transpose(1, 2)
        k, v = (p(x).view(n, x.shape[1], self.heads, -1).transpose(1, 2) for p in (self.k_proj, self.v_proj))
        weights = (q @ k.transpose(-1, -2) * (width // self.heads) ** -0.5).softmax(-1).to(v.dtype)
        return self.c_proj((weights @ v).transpose(1, 2).reshape(n, width))


class ModifiedResNet(nn.Module):
    """Returns the embedding and the activations of stages 0 (stem, before its pool) to 4."""

    def __init__(self, c: dict[str, Any], dim: int) -> None:
        super().__init__()
        width, self.stem_pool = c["width"], c["stem_pool"]
        self.conv1, self.bn1 = nn.Conv2d(3, width // 2, 3, 2, 1, bias=False), nn.BatchNorm2d(width // 2)
        self.conv2, self.bn2 = nn.Conv2d(width // 2, width // 2, 3, 1, 1, bias=False), nn.BatchNorm2d(width // 2)
        self.conv3, self.bn3 = nn.Conv2d(width // 2, width, 3, 1, 1, bias=False), nn.BatchNorm2d(width)
        inputs = width
        for stage, count in enumerate(c["layers"], 1):
            planes = width * 2 ** (stage - 1)
            blocks = [Bottleneck(inputs, planes, 1 if stage == 1 else 2)]
            blocks += [Bottleneck(planes * 4, planes, 1) for _ in range(count - 1)]
            setattr(self, f"layer{stage}", nn.Sequential(*blocks))
            inputs = planes * 4
        side = c["image_size"] // (32 if self.stem_pool else 16)
        self.attnpool = AttentionPool(side * side, inputs, c["num_attention_heads"], dim)

    def forward(self, x: Tensor) -> tuple[Tensor, list[Tensor]]:
        for conv, norm in ((self.conv1, self.bn1), (self.conv2, self.bn2), (self.conv3, self.bn3)):
            x = F.relu(norm(conv(x)), inplace=True)
        stages = [x]
        x = F.avg_pool2d(x, 2) if self.stem_pool else x
        for layer in (self.layer1, self.layer2, self.layer3, self.layer4):
            x = layer(x)
            stages.append(x)
        return self.attnpool(x), stages


class DecoderBlock(nn.Module):
    def __init__(self, width: int) -> None:
        super().__init__()
        self.conv1, self.conv2 = (nn.Conv2d(width, width, 3, padding=1) for _ in range(2))
        nn.init.zeros_(self.conv2.weight)

    def forward(self, a: Tensor) -> Tensor:
        return F.relu(a + self.conv2(F.relu(self.conv1(a), inplace=True)), inplace=True)


class FilmPyramid(nn.Module):
    """From deep to shallow: add the reduced stage, scale and shift by the text (FiLM), refine; one logit a pixel.

    `forward(stages, text, owner)`: text is M x D (length 1), owner (M) says whose picture each query looks at, so one
    trunk pass serves several queries. Returns M x h x w at the shallowest stage's resolution.
    """

    def __init__(self, c: dict[str, Any], channels: list[int], dim: int) -> None:
        super().__init__()
        width, self.stages, self.conditional = c["reduce_dim"], list(c["stages"]), c["conditional_stage"]
        named = {str(s): s for s in self.stages}
        self.reduces = nn.ModuleDict({k: nn.Conv2d(channels[s], width, 1) for k, s in named.items()})
        self.blocks = nn.ModuleDict({k: DecoderBlock(width) for k in named})
        if self.conditional < 0:
            self.film_mul = nn.ModuleDict({k: nn.Linear(dim, width) for k in named})
            self.film_add = nn.ModuleDict({k: nn.Linear(dim, width) for k in named})
        else:
            self.film_mul, self.film_add = nn.Linear(dim, width), nn.Linear(dim, width)
        self.head = nn.Conv2d(width, 1, 3, padding=1)
        for k in named if self.conditional < 0 else ():
            nn.init.ones_(self.film_mul[k].bias)
            nn.init.zeros_(self.film_add[k].bias)

    def film(self, stage: int, a: Tensor, text: Tensor) -> Tensor:
        if self.conditional >= 0 and stage != self.conditional:
            return a
        mul, add = self.film_mul, self.film_add
        if self.conditional < 0:
            mul, add = mul[str(stage)], add[str(stage)]
        return mul(text)[..., None, None].to(a.dtype) * a + add(text)[..., None, None].to(a.dtype)

    def forward(self, stages: list[Tensor], text: Tensor, owner: Tensor) -> Tensor:
        a = None
        for s in reversed(self.stages):
            x = self.reduces[str(s)](stages[s])[owner]
            if a is not None:
                x = x + F.interpolate(a, x.shape[-2:], mode="bilinear", align_corners=False)
            a = self.blocks[str(s)](self.film(s, x, text))
        return self.head(a)[:, 0]


class Guidance(nn.Module):
    """Both towers, the temperature and the segmenter; its state_dict is `model.safetensors`."""

    def __init__(self, config: dict[str, Any]) -> None:
        super().__init__()
        self.config = config
        text, vision, dim = config["text_config"], config["vision_config"], config["projection_dim"]
        self.text_model = TextModel(text)
        self.text_projection = nn.Linear(text["hidden_size"], dim, bias=False)
        self.visual = ModifiedResNet(vision, dim)
        channels = [vision["width"]] + [vision["width"] * 4 * 2**s for s in range(4)]
        self.decoder = FilmPyramid(config["segmenter_config"], channels, dim)
        self.logit_scale = nn.Parameter(torch.tensor(float(config["logit_scale_init_value"])))
        pre = config["preprocess"]
        for name, values in (("mean", pre["image_mean"]), ("std", pre["image_std"])):
            self.register_buffer(name, torch.tensor(values).view(1, 3, 1, 1), persistent=False)

    def preprocess(self, images: Tensor) -> Tensor:
        x = (images - self.mean) / self.std
        return x.contiguous(memory_format=torch.channels_last)

    def encode_image(self, images: Tensor) -> Tensor:
        return self.visual(self.preprocess(images))[0].float()

    def encode_text(self, ids: Tensor) -> Tensor:
        return self.text_projection(self.text_model(ids)).float()

    def segment(self, images: Tensor, text: Tensor, owner: Tensor | None = None) -> Tensor:
        """Logits M x S x S; text are unit embeddings, one a picture unless `owner` says otherwise."""
        stages = self.visual(self.preprocess(images))[1]
        owner = torch.arange(len(images), device=images.device) if owner is None else owner
        logits = self.decoder(stages, text, owner)[:, None].float()
        return F.interpolate(logits, images.shape[-2:], mode="bilinear", align_corners=False)[:, 0]
