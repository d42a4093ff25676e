"""The synthetic volume in blob.vdb, in closed form, and an independent march of it: what Cycles is compared with.

Voxel (i, j, k) of 24³ has its centre at p = h·(i − 11.5, …) and, in the world, at R p + t, with R = Rz(0.5) Rx(0.3):
a turned and shifted grid, so that axes, transform and half-voxel corrections all show. tests/vdb_export checks the file
against the same formulas.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

PATH = Path(__file__).resolve().parent / "blob.vdb"
COUNT, VOXEL = 24, 0.08
SHIFT = np.array([0.1, -0.05, 0.2])


def rotation() -> np.ndarray:
    cz, sz, cx, sx = np.cos(0.5), np.sin(0.5), np.cos(0.3), np.sin(0.3)
    about_z = np.array([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
    return about_z @ about_x


def grids() -> tuple[np.ndarray, np.ndarray]:
    """Density N³ and colour N³×3 as the file holds them: rounded to half precision."""
    line = (np.arange(COUNT) - 0.5 * (COUNT - 1)) * VOXEL
    x, y, z = np.meshgrid(line, line, line, indexing="ij")
    r2 = x * x + y * y / 0.8 + z * z / 0.6
    density = 8.0 * np.maximum(0.0, 1.0 - r2 / 0.55)
    color = np.stack([0.5 + 0.5 * np.sin(5 * x), 0.5 + 0.5 * np.sin(4 * y), 0.5 + 0.4 * np.cos(6 * z)], axis=-1)
    color = filled(color.astype(np.float32), density > 0.0, rounds=2)
    return density.astype(np.float16).astype(np.float64), color.astype(np.float16).astype(np.float64)


def filled(color: np.ndarray, known: np.ndarray, rounds: int) -> np.ndarray:
    """Voxels that touch a coloured one get the mean of their coloured neighbours, round by round; 0 further out."""
    color = np.where(known[..., None], color, 0.0)
    for _ in range(rounds):
        wide_color, wide_known = np.pad(color, [(1, 1)] * 3 + [(0, 0)]), np.pad(known, 1)
        total, count = np.zeros_like(color), np.zeros(known.shape)
        for x, y, z in np.ndindex(3, 3, 3):
            near = (slice(x, x + COUNT), slice(y, y + COUNT), slice(z, z + COUNT))
            total, count = total + wide_color[near], count + wide_known[near]
        color = np.where(known[..., None], color, total / np.maximum(count, 1)[..., None])
        known = count > 0
    return color


def _trilinear(grid: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Values at index-space points (…×3), 0 outside the grid."""
    padded = np.pad(grid, [(1, 1)] * 3 + [(0, 0)] * (grid.ndim - 3))
    index = np.clip(index + 1.0, 0.0, COUNT + 0.999)
    low = np.floor(index).astype(int)
    share = index - low
    total = 0.0
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(np.array(corner) == 1, share, 1.0 - share), axis=-1)
        value = padded[tuple(np.moveaxis(low + np.array(corner), -1, 0))]
        total = total + (weight[..., None] if grid.ndim == 4 else weight) * value
    return total


def march(matrix: np.ndarray, width: int, height: int, angle_x: float, step: float) -> np.ndarray:
    """H×W×4: Σ T (1 − exp(−σδ)) c and 1 − T, rays through pixel centres, equal steps (midpoint rule)."""
    focal = 0.5 * width / np.tan(0.5 * angle_x)
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    local = np.stack([(x - 0.5 * width) / focal, -(y - 0.5 * height) / focal, -np.ones_like(x)], axis=-1)
    direction = local @ matrix[:3, :3].T
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    origin = matrix[:3, 3]
    density, color = grids()
    reach = COUNT * VOXEL  # half the grid's diagonal is less
    middle = np.linalg.norm(origin - SHIFT)
    result, transmittance = np.zeros((height, width, 3)), np.ones((height, width))
    for t in np.arange(middle - reach, middle + reach, step) + 0.5 * step:
        index = (origin + t * direction - SHIFT) @ rotation() / VOXEL + 0.5 * (COUNT - 1)
        alpha = -np.expm1(-_trilinear(density, index) * step)
        result += (transmittance * alpha)[..., None] * _trilinear(color, index)
        transmittance *= 1.0 - alpha
    return np.concatenate([result, 1.0 - transmittance[..., None]], axis=-1)
