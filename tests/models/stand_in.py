"""A few coloured squares and discs behind the scene generator's interface: loss and step tests need no build."""

from __future__ import annotations

from typing import Any

import numpy as np

SHAPES, MATERIALS, COLOURS = ["cube", "ball"], ["plain", "striped"], ["red", "green", "blue"]
PAINT = np.array([[220, 30, 30], [30, 180, 40], [40, 60, 220]], np.uint8)


class Generator:
    """Pairs differ in colour; queries: the thing, the ground, an absent thing, "photo"."""

    def __init__(self, seed: int, split: str = "train", size: int = 64, settings: str = "") -> None:
        self.random, self.size = np.random.default_rng(seed), size

    def vocabulary(self) -> dict[str, list[str]]:
        return {"shapes": SHAPES, "materials": MATERIALS, "colours": COLOURS, "parts": [], "additions": []}

    def batch(self, n: int, threads: int = 1) -> dict[str, Any]:
        size = self.size
        images = np.full((n, 2, size, size, 3), 255, np.uint8)
        masks = np.zeros((n, 2, 4, size, size), np.uint8)
        attributes = np.full((n, 2, 3), -1, np.int16)
        truth = np.zeros((n, 2, 3), np.int16)
        captions, queries = [], []
        y, x = np.mgrid[:size, :size]
        for i in range(n):
            shape, colour = int(self.random.integers(2)), int(self.random.integers(3))
            pair = (colour, (colour + 1 + int(self.random.integers(2))) % 3)
            cy, cx, r = self.random.integers(20, 44), self.random.integers(20, 44), self.random.integers(10, 18)
            distance = np.hypot(y - cy, x - cx) if shape else np.maximum(abs(y - cy), abs(x - cx))
            inside = distance < r
            for k, c in enumerate(pair):
                images[i, k][inside] = PAINT[c]
                masks[i, k, 0], masks[i, k, 1] = inside, y > 50
                attributes[i, k] = shape, -1, c
                truth[i, k] = shape, 0, c
            captions.append(tuple(f"a {COLOURS[c]} {SHAPES[shape]}" for c in pair))
            queries.append([[SHAPES[shape], "ground", SHAPES[1 - shape], "photo"]] * 2)
        kinds = np.broadcast_to(np.array([0, 2, 3, 5], np.uint8), (n, 2, 4)).copy()
        return {
            "images": images,
            "captions": captions,
            "change": np.zeros(n, np.uint8),
            "attributes": attributes,
            "truth": truth,
            "beside": np.zeros((n, 2, 3), np.uint64),
            "queries": queries,
            "masks": masks,
            "query_kinds": kinds,
            "spec": [("{}", "{}")] * n,
        }
