"""The same training step in plain PyTorch, as the reference that our kernels' speed is told by.

Same network as a field's configuration says (levels, features, table, widths; no biases, spherical harmonics of degree
4), same number of samples a step, Adam over all parameters. The hash encoding is written with tensor operations over
all levels and corners at once, as nerfstudio's own CPU path (`implementation="torch"`) does it. Samples are given, as
marching is not what is compared: rays of 16 samples each through the unit cube.
"""

from __future__ import annotations

import statistics
import time
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F

PRIMES = (1, 2654435761, 805459861)
SAMPLES_A_RAY = 16


class EagerField(nn.Module):
    def __init__(self, config: dict[str, Any]) -> None:
        """config: as `fieldgraft info` shows it."""
        super().__init__()
        levels, features = config["levels"], config["features_per_level"]
        base, finest = config["base_resolution"], config["finest_resolution"]
        growth = (finest / base) ** (1 / (levels - 1))
        self.register_buffer("scales", torch.tensor([float(int(base * growth**i + 0.5)) for i in range(levels)]))
        self.size = 1 << config["log2_table_size"]
        self.table = nn.Parameter(torch.empty(levels * self.size, features).uniform_(-1e-4, 1e-4))
        density, color, size = config["density_hidden"], config["color_hidden"], config["feature_size"]
        linear = [(levels * features, density), (density, size), (16 + size, color), (color, color), (color, 3)]
        self.layers = nn.ModuleList(nn.Linear(i, o, bias=False) for i, o in linear)

    def encode(self, x: Tensor) -> Tensor:
        """N×3 in the unit cube → N×(levels·features)."""
        scaled = x[:, None] * self.scales[:, None]  # N×L×3
        lower = scaled.floor()
        part, cell = scaled - lower, lower.long()
        offset = torch.arange(len(self.scales)) * self.size
        out = 0
        for corner in range(8):
            bits = torch.tensor([corner >> c & 1 for c in range(3)])
            at = cell + bits
            hashed = at[..., 0] * PRIMES[0] ^ at[..., 1] * PRIMES[1] ^ at[..., 2] * PRIMES[2]
            weight = torch.where(bits.bool(), part, 1 - part).prod(-1, keepdim=True)
            out = out + weight * self.table[(hashed & (self.size - 1)) + offset]
        return out.flatten(1)

    def forward(self, x: Tensor, basis: Tensor) -> tuple[Tensor, Tensor]:
        """Density N and colour N×3; basis N×16: spherical harmonics of the directions."""
        features = self.layers[1](F.relu(self.layers[0](self.encode(x))))
        hidden = F.relu(self.layers[2](torch.cat([basis, features], 1)))
        color = torch.sigmoid(self.layers[4](F.relu(self.layers[3](hidden))))
        return torch.exp(features[:, 0] - 1), color


def step_loss(field: EagerField, x: Tensor, basis: Tensor, target: Tensor, delta: float) -> Tensor:
    density, color = field(x, basis)
    depth = (density * delta).view(-1, SAMPLES_A_RAY)
    before = torch.exp(-(depth.cumsum(1) - depth))
    weights = before * -torch.expm1(-depth)
    shown = (weights[..., None] * color.view(-1, SAMPLES_A_RAY, 3)).sum(1)
    return F.mse_loss(shown, target)


def microseconds_a_sample(threads: int, config: dict[str, Any], samples: int = 1 << 15, steps: int = 5) -> dict:
    """Median, fastest and slowest of `steps` training steps after one that is not counted."""
    torch.set_num_threads(threads)
    torch.manual_seed(0)
    field = EagerField(config)
    adam = torch.optim.Adam(field.parameters(), lr=1e-2, betas=(0.9, 0.99), eps=1e-15)
    rays = samples // SAMPLES_A_RAY
    start, aim = torch.rand(rays, 1, 3) * 0.6 + 0.2, F.normalize(torch.randn(rays, 1, 3), dim=-1)
    x = (start + aim * torch.arange(SAMPLES_A_RAY).view(1, -1, 1) * 0.0017).view(-1, 3)
    basis, target = torch.randn(samples, 16), torch.rand(rays, 3)
    times = []
    for _ in range(steps + 1):
        begin = time.perf_counter()
        adam.zero_grad()
        step_loss(field, x, basis, target, 0.0017).backward()
        adam.step()
        times.append((time.perf_counter() - begin) / samples * 1e6)
    times = sorted(times[1:])
    return {"median": round(statistics.median(times), 2), "min": round(times[0], 2), "max": round(times[-1], 2)}
