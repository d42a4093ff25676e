"""The losses that train the guidance model. All take float32; embeddings of length 1 are called unit embeddings.

* `attribute_loss`  cross-entropy of cos(E(I), E(word)) over the vocabulary's words; unsaid attributes (-1) are skipped.
  Words that would make a combination kept out of training are no alternatives there (`never_shown`), nor are those
  that fit another object in the picture (`never_wrong`): which of two is meant, only the caption says.
* `contrastive_loss` symmetric InfoNCE (CLIP, sec. 2.3) between pictures and captions; a caption that may be true of
  another picture too (attribute truth agrees wherever both are said) is no negative there, nor is one with a word that
  would make a held-out combination of that picture: "a mug" beside a red cylinder would say that red mugs do not exist.
* `direction_loss`  the same between picture differences u(E(I1)) - u(E(I2)) and caption differences over the pairs:
  what a directional edit loss measures (StyleGAN-NADA, sec. 4.1); norms softened, as twins may be alike.
* `mask_loss`       balanced cross-entropy plus Dice for things that are there, cross-entropy for absent ones (their
  surest pixels by themselves), and a pull of "photo" to logit 0, which makes "photo" a neutral threshold.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from network import unit
from torch import Tensor
from torch.nn import functional as F

OBJECT, PART, GROUND, ABSENT, ATTRIBUTE, PHOTO, ADDITION = range(7)
SOFTNESS = 1e-2
SUREST = 0.01  # of the pixels
MARGIN = 1.0  # by which an absent thing's logits should stay below the neutral 0


NO_CHANCE = -1e4


class HeldOut:
    """Which (shape, material, colour) combinations training never shows.

    A loss that calls the word of such a combination wrong teaches that white trucks do not exist. With the prior of
    the training split in the logits (Menon et al. 2021, logit adjustment: log 0 here) nothing is learnt about them
    either way.
    """

    def __init__(self, held_out: Callable[[int, int, int], bool], takes_colour: list[bool], sizes: list[int]) -> None:
        shapes, materials, colours = sizes
        self.colours = colours
        every = [
            [[held_out(s, m, c if c < colours else -1) for c in range(colours + 1)] for m in range(materials)]
            for s in range(shapes)
        ]
        self.table = torch.tensor(every)  # S x M x (C + 1); the last: no colour
        # By shape and colour, for each material: in that colour where the material takes one.
        takes = torch.tensor(takes_colour)[None, :, None]
        self.by_material = torch.where(takes, self.table, self.table[:, :, -1:]).transpose(1, 2)

    @classmethod
    def of(cls, module: Any, vocabulary: dict[str, list[str]]) -> HeldOut:
        """What the generator (its compiled module) keeps out of training."""
        sizes = [len(vocabulary[a]) for a in ("shapes", "materials", "colours")]
        return cls(module.is_held_out, [module.takes_colour(m) for m in range(sizes[1])], sizes)

    def never_wrong(self, truth: Tensor, beside: Tensor) -> list[Tensor]:
        """`never_shown`, and the words that fit another object in the picture (`beside`: bits, N x 3)."""
        masks = self.never_shown(truth)
        for i, mask in enumerate(masks):
            bits = torch.arange(mask.shape[1], device=mask.device)
            fits = (beside[:, i, None].to(mask.device) >> bits & 1).bool()
            right = truth[:, i, None].to(mask.device) == bits
            mask |= fits & ~right
        return masks

    def never_shown(self, truth: Tensor) -> list[Tensor]:
        """truth N x 3, complete (colour -1: none). N x K bool an attribute: alternatives that are held out."""
        shape, material, colour = truth.cpu().unbind(1)
        colour = torch.where(colour < 0, self.colours, colour)
        masks = [self.table[:, material, colour].T, self.by_material[shape, colour], self.table[shape, material, :-1]]
        for mask, right in zip(masks, truth.cpu().unbind(1), strict=True):
            known = right >= 0
            mask[known.nonzero()[:, 0], right[known]] = False
        return [m.to(truth.device) for m in masks]


def attribute_loss(
    images: Tensor, words: list[Tensor], truth: Tensor, scale: Tensor, never: list[Tensor] | None = None
) -> Tensor:
    """images N x D unit; words: for each attribute K_a x D unit; truth N x A, -1 where unsaid; never: `never_shown`."""
    return head_loss([scale * images @ embeddings.T for embeddings in words], truth, never)


def head_loss(logits: list[Tensor], truth: Tensor, never: list[Tensor] | None = None) -> Tensor:
    """Cross-entropy over each attribute's alternatives, logits N x K_a: of plain linear heads, for instance."""
    losses = []
    for i, x in enumerate(logits):
        x = x if never is None else x.masked_fill(never[i], NO_CHANCE)
        known = (truth[:, i] >= 0).sum().clamp_min(1)
        losses.append(F.cross_entropy(x, truth[:, i], ignore_index=-1, reduction="sum") / known)
    return torch.stack(losses).sum()


def compatible(truth: Tensor) -> Tensor:
    """N x N: could caption j be true of picture i? Said attributes agree or are unsaid in one of them."""
    a, b = truth[:, None], truth[None]
    return ((a == b) | (a < 0) | (b < 0)).all(-1)


def says_never_shown(never: list[Tensor], said: Tensor) -> Tensor:
    """N x N: does caption j say a word that is kept out of training together with what picture i is (`never_shown`)?
    said N x A, -1 where unsaid."""
    result = torch.zeros(len(said), len(said), dtype=torch.bool, device=said.device)
    for mask, words in zip(never, said.unbind(1), strict=True):
        result |= mask[:, words.clamp_min(0)] & (words >= 0)
    return result


def contrastive_loss(
    images: Tensor, texts: Tensor, truth: Tensor, captions: list[str], scale: Tensor, never: list[Tensor] | None = None
) -> Tensor:
    """Unit embeddings N x D, twins in neighbouring rows; truth N x A: what the captions say; never: `never_shown`. A
    twin's caption is always a negative: telling the two apart is the point, even where the vaguer caption is true of
    both."""
    n = len(images)
    row = torch.arange(n, device=images.device)
    mask = compatible(truth) if never is None else compatible(truth) | says_never_shown(never, truth)
    mask[row, row ^ 1] = False
    same = {c: i for i, c in enumerate(dict.fromkeys(captions))}
    ids = torch.tensor([same[c] for c in captions], device=images.device)
    mask |= ids[:, None] == ids[None]
    mask[row, row] = False
    logits = (scale * images @ texts.T).masked_fill(mask, NO_CHANCE)
    return 0.5 * (F.cross_entropy(logits, row) + F.cross_entropy(logits.T, row))


def change_keys(captions: list[str]) -> list[tuple[frozenset[str], frozenset[str]]]:
    """What each pair's captions differ in: the words only the first and only the second has."""
    words = [frozenset(c.split()) for c in captions]
    return [(a - b, b - a) for a, b in zip(words[::2], words[1::2], strict=True)]


def direction_loss(images: Tensor, texts: Tensor, captions: list[str], scale: float = 10.0) -> Tensor:
    """Unit embeddings, twins in neighbouring rows; equal changes are no negatives of each other."""
    moved = unit(images[::2] - images[1::2], SOFTNESS)
    said = unit(texts[::2] - texts[1::2], SOFTNESS)
    keys = change_keys(captions)
    first = {k: i for i, k in enumerate(dict.fromkeys(keys))}
    ids = torch.tensor([first[k] for k in keys], device=images.device)
    row = torch.arange(len(keys), device=images.device)
    equal = (ids[:, None] == ids[None]) & (row[:, None] != row[None])
    logits = (scale * moved @ said.T).masked_fill(equal, NO_CHANCE)
    pull = 1 - (moved * said).sum(-1).mean()
    return 0.5 * (F.cross_entropy(logits, row) + F.cross_entropy(logits.T, row)) + pull


def mask_loss(logits: Tensor, masks: Tensor, valid: Tensor, kinds: Tensor) -> Tensor:
    """logits M x S x S; masks and valid bool alike; kinds M. A mean over queries."""
    valid = valid.float()
    area = valid.sum((1, 2)).clamp_min(1)
    target = masks.float()
    cross = F.binary_cross_entropy_with_logits(logits, target, reduction="none") * valid
    photo = kinds == PHOTO
    present = (kinds != ABSENT) & ~photo & ((target * valid).sum((1, 2)) > 0)
    # Half of the weight for the plain mean, half for the thing's own pixels: small parts count as much as large ones.
    inside = (cross * target).sum((1, 2)) / (target * valid).sum((1, 2)).clamp_min(1)
    plain = cross.sum((1, 2)) / area
    chance = torch.sigmoid(logits) * valid
    dice = 1 - (2 * (chance * target).sum((1, 2)) + 1) / (chance.sum((1, 2)) + (target * valid).sum((1, 2)) + 1)
    level = (F.softplus(logits) - 0.5 * logits - 0.6931472) * valid  # cross-entropy to one half, less its least value
    # What is not there: the surest percent of the pixels, which alone would mark something, counts by itself.
    surest = max(1, round(SUREST * logits[0].numel()))
    top = F.softplus(logits.masked_fill(valid == 0, -20.0).flatten(1).topk(surest, 1).values + MARGIN).mean(1)
    loss = torch.where(present, plain + 0.5 * inside + dice, 3 * plain + 0.5 * top)
    return torch.where(photo, level.sum((1, 2)) / area, loss).mean()
