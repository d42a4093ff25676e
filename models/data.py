"""Training pictures: batches from the C++ scene generator, made in the background, and their augmentation.

A batch is `n` pairs (a scene and its counterfactual twin) as 2n pictures, 0/1 interleaved: row 2i is pair i's scene,
row 2i+1 its twin. Pictures are uint8 S x S x 3 from the generator, float32 N x 3 x S x S in [0, 1] here.
The augmentation is what the edit loop does at guidance time, with the same parameters for both twins: a random
similarity and perspective warp, translation, cutout, mild colour jitter, and blur (fields render softly).
"""

from __future__ import annotations

import json
import queue
import random
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import generator_build
import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

ROOT = Path(__file__).resolve().parent.parent


def load_generator_module() -> Any:
    """The compiled `scene_generator`, built first if need be."""
    return generator_build.load()


@dataclass
class Batch:
    """Everything a step needs. N = 2n pictures; queries are flat lists with `owner` naming their picture."""

    images: Tensor  # uint8 N x 3 x S x S
    captions: list[str]  # N
    change: Tensor  # int64 n
    attributes: Tensor  # int64 N x 3 (shape, material, colour), -1 where the caption does not say
    truth: Tensor  # int64 N x 3, the same whatever the caption says; colour -1: none of the vocabulary's
    beside: Tensor  # int64 N x 3: bits of the words that fit other clearly visible objects
    queries: list[list[str]]  # N x Q
    masks: Tensor  # uint8 N x Q x S x S
    kinds: Tensor  # uint8 N x Q


def to_batch(raw: dict[str, Any]) -> Batch:
    """The generator's dictionary with pairs flattened into rows."""
    images = np.asarray(raw["images"])
    n, _, size = images.shape[:3]
    masks = np.asarray(raw["masks"])
    return Batch(
        images=torch.from_numpy(images.reshape(2 * n, size, size, 3)).permute(0, 3, 1, 2),
        captions=[c for pair in raw["captions"] for c in pair],
        change=torch.from_numpy(np.asarray(raw["change"]).astype(np.int64)),
        attributes=torch.from_numpy(np.asarray(raw["attributes"]).astype(np.int64).reshape(2 * n, 3)),
        truth=torch.from_numpy(np.asarray(raw["truth"]).astype(np.int64).reshape(2 * n, 3)),
        beside=torch.from_numpy(np.asarray(raw["beside"]).astype(np.int64).reshape(2 * n, 3)),
        queries=[list(q) for pair in raw["queries"] for q in pair],
        masks=torch.from_numpy(masks.reshape(2 * n, *masks.shape[2:])),
        kinds=torch.from_numpy(np.asarray(raw["query_kinds"]).reshape(2 * n, -1)),
    )


class Stream:
    """An endless stream of batches, a few made ahead by a background thread (the generator releases the GIL).

    A generated batch comes twice: fresh, and once more, augmented anew, after about `KEPT` other batches; drawing a
    picture costs time too. `generator` may be changed at any time.
    """

    KEPT = 60

    def __init__(self, generator: Any, pairs: int, seed: int = 0, ahead: int = 3) -> None:
        self.generator, self._pairs = generator, pairs
        self._queue: queue.Queue[Batch | BaseException] = queue.Queue(ahead)
        self._stop = threading.Event()
        self._kept: list[Batch] = []
        self._random, self._fresh = random.Random(seed), True
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def _work(self) -> None:
        while not self._stop.is_set():
            try:
                item: Batch | BaseException = to_batch(self.generator.batch(self._pairs, threads=1))
            except Exception as error:  # handed to the reader, which raises it
                item = error
            while not self._stop.is_set():
                try:
                    self._queue.put(item, timeout=0.2)
                    break
                except queue.Full:
                    continue
            if isinstance(item, BaseException):
                return

    def __iter__(self) -> Iterator[Batch]:
        return self

    def fresh(self) -> Batch:
        """A batch never seen before."""
        item = self._queue.get()
        if isinstance(item, BaseException):
            raise item
        return item

    def __next__(self) -> Batch:
        self._fresh = not self._fresh or len(self._kept) < self.KEPT
        if not self._fresh:
            return self._kept.pop(self._random.randrange(len(self._kept)))
        self._kept.append(self.fresh())
        return self._kept[-1]

    def close(self) -> None:
        self._stop.set()
        self._thread.join()


class Singles:
    """Batches of unrelated pictures (no queries or captions) out of a stream's last `KEPT`, each used about twice.

    What a scene is, is learnt faster from different scenes than from twins.
    """

    KEPT = 3000

    def __init__(self, stream: Stream, count: int, rng: torch.Generator) -> None:
        self._stream, self._count, self._rng = stream, count, rng
        self._images = torch.zeros(0, 3, 0, 0, dtype=torch.uint8)
        self._known = torch.zeros(0, 9, dtype=torch.int64)  # said attributes, the true ones, those beside
        self._drawn = 0

    def _refill(self) -> None:
        """The oldest pictures give way."""
        new = self._stream.fresh()
        old = len(self._images) and max(0, self.KEPT - len(new.images))
        self._images = torch.cat([self._images[-old:], new.images]) if old else new.images
        known = torch.cat([new.attributes, new.truth, new.beside], 1)
        self._known = torch.cat([self._known[-old:], known]) if old else known

    def __iter__(self) -> Iterator[Batch]:
        return self

    def __next__(self) -> Batch:
        self._drawn += 1
        if self._drawn % 2 or len(self._images) < self.KEPT // 4:
            self._refill()
        chosen = torch.randperm(len(self._images), generator=self._rng)[: self._count]
        empty = torch.zeros(len(chosen), 0, dtype=torch.uint8)
        said, truth, beside = self._known[chosen].split(3, 1)
        return Batch(self._images[chosen], [], empty, said, truth, beside, [], empty, empty)


def pair_rows(values: Tensor) -> Tensor:
    """n values, one a pair, to 2n rows."""
    return values.repeat_interleave(2, 0)


def random_warps(pairs: int, strength: float, rng: torch.Generator) -> Tensor:
    """N x 3 x 3 homographies from output to input coordinates in [-1, 1], the same for both twins.

    Scale 0.75-1.3, rotation up to 12 degrees, mirror half the time, shift up to 0.25, perspective up to 0.25;
    a fifth of the pairs stay as they are.
    """

    def uniform(low: float, high: float) -> Tensor:
        return torch.rand(pairs, generator=rng) * (high - low) + low

    turn = uniform(-0.21, 0.21) * strength
    scale = torch.exp(uniform(-0.29, 0.26) * strength)
    mirror = torch.where(uniform(0, 1) < 0.5, -1.0, 1.0)
    warp = torch.zeros(pairs, 3, 3)
    warp[:, 0, 0], warp[:, 0, 1] = mirror * scale * turn.cos(), -scale * turn.sin()
    warp[:, 1, 0], warp[:, 1, 1] = mirror * scale * turn.sin(), scale * turn.cos()
    warp[:, 0, 2], warp[:, 1, 2] = uniform(-0.25, 0.25) * strength, uniform(-0.25, 0.25) * strength
    warp[:, 2, 0], warp[:, 2, 1] = uniform(-0.25, 0.25) * strength, uniform(-0.25, 0.25) * strength
    warp[:, 2, 2] = 1
    still = uniform(0, 1) < 0.2
    warp[still] = torch.eye(3)
    return pair_rows(warp)


def warp_grid(warps: Tensor, size: int) -> Tensor:
    """Sampling positions N x S x S x 2 for grid_sample (align_corners false)."""
    axis = (torch.arange(size, dtype=torch.float32) + 0.5) * (2 / size) - 1
    y, x = torch.meshgrid(axis, axis, indexing="ij")
    points = torch.stack([x, y, torch.ones_like(x)], -1).view(1, -1, 3)
    mapped = points @ warps.transpose(1, 2)
    return (mapped[..., :2] / mapped[..., 2:].clamp_min(0.2)).view(-1, size, size, 2)


def jitter_colour(images: Tensor, amount: dict[str, float], rng: torch.Generator) -> Tensor:
    """DiffAugment's three colour changes: brightness +-b, saturation and contrast 1 +- s, 1 +- c; one draw a pair."""

    def draw(name: str) -> Tensor:
        return pair_rows((torch.rand(len(images) // 2, generator=rng) * 2 - 1) * amount[name]).view(-1, 1, 1, 1)

    images = images + draw("brightness")
    grey = images.mean(1, keepdim=True)
    images = grey + (images - grey) * (1 + draw("saturation"))
    level = images.mean((1, 2, 3), keepdim=True)
    return (level + (images - level) * (1 + draw("contrast"))).clamp(0, 1)


def cut_out(images: Tensor, valid: Tensor, rng: torch.Generator) -> None:
    """Grey out one square (a quarter to almost half a side) in a fifth of the pairs; `valid` forgets those pixels."""
    size = images.shape[-1]
    for pair in range(len(images) // 2):
        draw = torch.rand(4, generator=rng)
        if draw[0] < 0.2:
            side = int(size * (0.2 + 0.25 * draw[1]))
            y, x = int(draw[2] * (size - side)), int(draw[3] * (size - side))
            images[2 * pair : 2 * pair + 2, :, y : y + side, x : x + side] = 0.5
            valid[2 * pair : 2 * pair + 2, y : y + side, x : x + side] = False


def blur(images: Tensor, rng: torch.Generator) -> Tensor:
    """A quarter of the pairs pass through a lower resolution (24 to 48 pixels a side)."""
    size = images.shape[-1]
    chosen = pair_rows(torch.rand(len(images) // 2, generator=rng) < 0.25).nonzero()[:, 0]
    side = int(torch.randint(size * 3 // 8, size * 3 // 4 + 1, (1,), generator=rng))
    if len(chosen):
        small = F.interpolate(images[chosen], (side, side), mode="bilinear", align_corners=False, antialias=True)
        images[chosen] = F.interpolate(small, (size, size), mode="bilinear", align_corners=False)
    return images


@dataclass
class Augmented:
    images: Tensor  # float32 N x 3 x S x S
    masks: Tensor  # bool M x S x S, one a chosen query
    valid: Tensor  # bool N x S x S: pixels whose mask is known


def plain(batch: Batch, rows: Tensor, columns: Tensor) -> Augmented:
    """The pictures as they are, and the masks of the queries (rows[k], columns[k])."""
    images = batch.images.float() / 255
    n, size = len(images), images.shape[-1]
    masks = batch.masks[rows, columns] > 0 if len(rows) else torch.zeros(0, size, size, dtype=torch.bool)
    return Augmented(images, masks, torch.ones(n, size, size, dtype=torch.bool))


def augment(
    batch: Batch, rows: Tensor, columns: Tensor, amount: dict[str, float], rng: torch.Generator, strength: float = 0.7
) -> Augmented:
    """The augmented pictures, and the masks of the queries (rows[k], columns[k]) warped alike."""
    images = batch.images.float() / 255
    n, size = len(images), images.shape[-1]
    grid = warp_grid(random_warps(n // 2, strength, rng), size)
    # What the warp brings in from outside is white, black or any colour; the picture is moved to be 0 there.
    fill = torch.rand(n // 2, 3, generator=rng)
    style = torch.rand(n // 2, 1, generator=rng)
    fill = torch.where(style < 0.6, torch.ones(1), torch.where(style < 0.75, torch.zeros(1), fill))
    fill = pair_rows(fill)[:, :, None, None]
    images = F.grid_sample(images - fill, grid, mode="bilinear", align_corners=False) + fill
    images = jitter_colour(blur(images, rng), amount, rng)
    valid = torch.ones(n, size, size, dtype=torch.bool)
    cut_out(images, valid, rng)
    if not len(rows):
        return Augmented(images, torch.zeros(0, size, size, dtype=torch.bool), valid)
    masks = batch.masks[rows, columns][:, None].float()
    masks = F.grid_sample(masks, grid[rows], mode="bilinear", align_corners=False)[:, 0] > 0.5
    return Augmented(images, masks, valid)


def choose_queries(batch: Batch, count: int, rng: torch.Generator, weights: tuple[float, ...]) -> tuple[Tensor, Tensor]:
    """`count` different (row, column) pairs, a query's chance proportional to its kind's weight."""
    chance = torch.tensor(weights)[batch.kinds.long()].flatten()
    flat = torch.multinomial(chance, min(count, int((chance > 0).sum())), generator=rng)
    return flat // batch.kinds.shape[1], flat % batch.kinds.shape[1]


def read_settings(path: Path) -> str:
    """A settings file as the generator wants it: JSON text, checked to be JSON."""
    return json.dumps(json.loads(path.read_text(encoding="utf-8")))


# One object, whole, large, from the side, on white: where a lesson starts. The held-out settings are the generator's
# defaults, where it ends. A run that started at the end still told no shapes apart after a quarter of an hour.
EASY = {
    "addition": 0.0,
    "second_object": 0.0,
    "several": 0.0,
    "clutter": 0.0,
    "cropped": 0.0,
    "white_backdrop": 0.9,
    "no_ground": 0.85,
    "base_plate": 0.1,
    "endless_plane": 0.05,
    "grainy": 0.1,
    "blurred": 0.1,
    "shadows": 0.3,
    "primitive_tumbles": 0.1,
    "elevation_max": 50.0,
    "frame_min": 0.8,
    "frame_max": 1.0,
}


# All training pictures: what is said of an object is to be seen on a good part of it. "A blue stool" whose seat and
# legs have colours of their own, seen from where no blue shows, taught that words mean little.
TRUE_CAPTIONS = {"stated_share": 0.35}

# Several things at a time, often of one colour, and questions that colour alone would answer wrongly: what scenes
# are like. The segmenter that saw few of them took a yellow ring for the yellow monkey beside it.
CROWDED = TRUE_CAPTIONS | {
    "second_object": 0.35,
    "several": 0.05,
    "clutter": 0.6,
    "alike": 0.4,
    "shape_for_shape": 0.45,
}


def lesson(level: float) -> str:
    """Generator settings `level` of the way from EASY (0) to the full difficulty (1), as JSON."""
    if level >= 1:
        return json.dumps(TRUE_CAPTIONS)
    full = json.loads((generator_build.SOURCES / "heldout_settings.json").read_text(encoding="utf-8"))
    return json.dumps({k: v + (full[k] - v) * level for k, v in EASY.items()} | TRUE_CAPTIONS)
