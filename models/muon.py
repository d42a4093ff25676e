"""Muon for convolutions: momentum whose matrix is made nearly orthogonal before each step (Jordan et al. 2024).

A weight O x I x h x w is the matrix O x (I h w), K = I h w. Step: m <- b m + g, then
W <- (1 - rate decay) W - rate sqrt(max(1, O / K)) NS(g + b m), NS a few quintic Newton-Schulz iterations, in bfloat16.
torch.optim.Muon takes only matrices. Beside AdamW, on the same trunk and pictures for the same time, it told clearly
more shapes apart.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import torch
from torch import Tensor

COEFFICIENTS = (3.4445, -4.7750, 2.0315)


def nearly_orthogonal(matrix: Tensor, iterations: int = 3) -> Tensor:
    """Singular values of the matrix brought near 1 (0.3 to 1.3 after three iterations, unless they are tiny)."""
    a, b, c = COEFFICIENTS
    tall = matrix.shape[0] > matrix.shape[1]
    x = matrix.to(torch.bfloat16)
    x = x.T if tall else x
    x = x / (x.norm() + 1e-7)
    for _ in range(iterations):
        square = x @ x.T
        x = a * x + (b * square + c * (square @ square)) @ x
    return (x.T if tall else x).to(matrix.dtype)


class Muon(torch.optim.Optimizer):
    def __init__(
        self, parameters: Iterable[Tensor], lr: float = 0.02, momentum: float = 0.95, weight_decay: float = 0.02
    ) -> None:
        super().__init__(parameters, {"lr": lr, "momentum": momentum, "weight_decay": weight_decay})

    @torch.no_grad()
    def step(self, closure: Callable[[], Any] | None = None) -> None:  # type: ignore[override]
        for group in self.param_groups:
            for p in group["params"]:
                if p.grad is None:
                    continue
                state = self.state[p]
                momentum = state.setdefault("momentum", torch.zeros_like(p))
                momentum.mul_(group["momentum"]).add_(p.grad)
                update = p.grad + group["momentum"] * momentum
                rows, columns = len(p), p.numel() // len(p)
                update = nearly_orthogonal(update.reshape(rows, columns)).reshape(p.shape)
                p.mul_(1 - group["lr"] * group["weight_decay"])
                p.add_(update, alpha=-group["lr"] * max(1.0, rows / columns) ** 0.5)
