"""One training step of each stage, and the state that survives between runs.

Stage 1 teaches the trunk to recognise single pictures, hardly augmented (augmenting all of them slowed
learning): cross-entropy of plain heads and of the vocabulary's words.
Stage 2 adds captions (contrastive), twins (direction) and masks (segmenter), keeping the word cross-entropy.
Stage 3 is stage 2 with one-step adversarial pictures every third step: x + r g/|g| with r drawn from [0, 1.5] (L2
over the whole picture), which makes the gradients that later drive an edit follow what is seen.
The learning rate is constant in stage 1, falls from 70 to 30 % in stage 2 and to under 1 % in stage 3.
Exported weights are an exponential average of the steps, so any moment gives a usable snapshot.
"""

from __future__ import annotations

import math
import os
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import losses
import torch
from data import Augmented, Batch, augment, choose_queries, plain
from evaluate import WORD_TEMPLATES, word_prompts
from muon import Muon
from network import Guidance, unit
from torch import Tensor, nn
from torch.nn import functional as F
from workers import GOING

# A query's chance by kind: object, part, ground, absent, attribute only, photo, addition.
QUERY_WEIGHTS = (1.0, 1.4, 1.6, 1.2, 0.6, 1.2, 1.0)
QUERIES = 0.6  # queries a picture and step
WARP = {1: 0.5, 2: 0.6, 3: 0.6}
PLAIN_STEPS = {1: 0.8, 2: 0.5, 3: 0.5}  # share of the steps whose pictures are not augmented
WORD_STEPS = {1: 4, 2: 2, 3: 2}  # the words are embedded anew every so many steps; between them pictures learn alone
DECODER_SHARE = {2: 0.3, 3: 0.3}  # how much of the segmenter's gradient reaches the towers
AVERAGE = 0.998
MAX_RADIUS = 1.5
ATTACK_STEPS = 3  # every so manyth step is adversarial and costs twice a plain one
WARM_UP = 60
RATE = 1e-3  # AdamW's peak rate; `--rate` scales Muon's with it
MUON_RATE = 0.02
MEETING = 8  # steps between two averagings over the workers, and of the running average


@dataclass
class Progress:
    """Where training stands: minutes are of training time in the current stage."""

    stage: int = 1
    minutes: float = 0.0
    steps: int = 0
    stage_steps: int = 0
    pictures: int = 0
    seconds: float = 0.0
    done: list[int] = field(default_factory=list)


def gradient_share(x: Tensor, share: float) -> Tensor:
    """x forward; `share` of its gradient backward."""
    return x.detach() + share * (x - x.detach())


def adversarial(images: Tensor, gradient: Tensor, rng: torch.Generator) -> Tensor:
    """One step up the loss, of random length (L2, at most MAX_RADIUS, none for a third of the pictures), in [0, 1]."""
    length = gradient.flatten(1).norm(dim=1).clamp_min(1e-12)
    radius = torch.rand(len(images), generator=rng) * MAX_RADIUS
    radius[torch.rand(len(images), generator=rng) < 1 / 3] = 0
    step = (radius.to(images.device) / length).view(-1, 1, 1, 1)
    return (images + step * gradient).clamp(0, 1).detach()


class Trainer:
    """Model, optimiser, average and position; `step` does one batch."""

    def __init__(
        self,
        config: dict[str, Any],
        tokenizer: Any,
        vocabulary: dict[str, list[str]],
        held_out: losses.HeldOut,
        seed: int,
        device: str = "cpu",
        rate: float = 1e-3,
    ) -> None:
        torch.manual_seed(seed)
        self.config, self.tokenizer, self.vocabulary = config, tokenizer, vocabulary
        self.device, self.rate, self.workers, self.held_out = device, rate, None, held_out
        self.wish = self.stop = GOING  # what this rank wants, and what all have agreed on
        self.rng = torch.Generator().manual_seed(seed)
        self.model = Guidance(config).to(device, memory_format=torch.channels_last)
        sizes = [len(vocabulary[a]) for a in WORD_TEMPLATES]
        self.heads = nn.ModuleList(nn.Linear(config["projection_dim"], k) for k in sizes).to(device)
        self.word_scale = nn.Parameter(torch.tensor(math.log(20.0), device=device))
        convolutions, groups = self._groups()
        self.muon = Muon(convolutions)
        self.optimiser = torch.optim.AdamW(groups, lr=rate, betas=(0.9, 0.999), eps=1e-6, fused=True)
        self.progress = Progress()
        self.average = {k: v.detach().clone().float() for k, v in self.model.state_dict().items()}
        self.recent: dict[str, float] = {}
        self.said: list[Tensor] = []  # the words' last embeddings

    def _groups(self) -> tuple[list[Tensor], list[dict[str, Any]]]:
        """Muon's convolutions and AdamW's rest. Matrices decay, vectors do not. The attention pool and heads have no
        normalisation behind them and learn at a quarter of the rate."""
        convolutions: list[Tensor] = []
        groups: dict[tuple[bool, bool], list[Tensor]] = {}
        named = [*self.model.named_parameters(), ("word_scale", self.word_scale)]
        named += [(f"heads.{name}", p) for name, p in self.heads.named_parameters()]
        for name, p in named:
            if p.ndim == 4 and len(p) > 1 and name != "visual.conv1.weight":
                convolutions.append(p)
                continue
            groups.setdefault(("attnpool" in name or name.startswith("heads"), p.ndim > 1), []).append(p)
        return convolutions, [
            {"params": v, "weight_decay": 0.05 if matrix else 0.0, "share": 0.25 if slow else 1.0}
            for (slow, matrix), v in groups.items()
        ]

    # ---- one step -------------------------------------------------------------------------------------------------

    def encode(self, texts: list[str]) -> Tensor:
        ids = self.tokenizer(texts)
        # Tokens behind the last end of text see nothing and are not seen: most captions fill a third of the context.
        end = int((ids == self.model.text_model.eos).int().argmax(-1).max()) + 1
        return unit(self.model.encode_text(ids[:, :end].to(self.device)))

    def words(self) -> list[Tensor]:
        """The vocabulary's words under one random template each time."""
        result = []
        for attribute, templates in WORD_TEMPLATES.items():
            pick = int(torch.randint(len(templates), (1,), generator=self.rng))
            result.append(word_prompts(self.vocabulary, attribute, templates[pick]))
        flat = self.encode([w for words in result for w in words])
        return list(flat.split([len(words) for words in result]))

    def templated(self, captions: list[str]) -> list[str]:
        """A third of the captions inside one of the model's own templates."""
        templates = self.config["templates"]
        dice = torch.rand(len(captions), 2, generator=self.rng)
        return [
            templates[int(d[1] * len(templates))].format(c) if d[0] < 0.33 and "photo" not in c else c
            for c, d in zip(captions, dice, strict=True)
        ]

    def tower_losses(
        self, images: Tensor, batch: Batch, words: list[Tensor], captions: Tensor | None, truth: Tensor
    ) -> tuple[dict[str, Tensor], list[Tensor]]:
        """All losses on the picture embedding, and the trunk's activations."""
        embeddings, stages = self.model.visual(self.model.preprocess(images))
        embeddings = embeddings.float()
        seen = unit(embeddings)
        never = self.held_out.never_wrong(batch.truth.to(truth.device), batch.beside)
        out = {"heads": losses.head_loss([h(embeddings).float() for h in self.heads], truth, never)}
        out["words"] = losses.attribute_loss(seen, words, truth, self.word_scale.clamp(max=4.1).exp(), never)
        if captions is not None:
            scale = self.model.logit_scale.clamp(max=4.6).exp()
            kept_out = self.held_out.never_shown(batch.truth.to(truth.device))
            out["captions"] = losses.contrastive_loss(seen, captions, truth, batch.captions, scale, kept_out)
            out["twins"] = losses.direction_loss(seen, captions, batch.captions)
        return out, stages

    WEIGHTS = {"words": 1.0, "heads": 0.7, "captions": 1.0, "twins": 0.5, "masks": 2.0}

    def total(self, parts: dict[str, Tensor]) -> Tensor:
        return torch.stack([self.WEIGHTS[k] * v for k, v in parts.items()]).sum()

    def step(self, batch: Batch, fraction: float) -> dict[str, float]:
        """One optimiser step; `fraction` of the stage's time that has passed sets the learning rate."""
        stage = self.progress.stage
        count = len(batch.images)
        rows = columns = torch.zeros(0, dtype=torch.int64)
        if stage > 1:
            rows, columns = choose_queries(batch, int(QUERIES * count), self.rng, QUERY_WEIGHTS)
        if float(torch.rand(1, generator=self.rng)) < PLAIN_STEPS[stage]:
            made = plain(batch, rows, columns)
        else:
            made = augment(batch, rows, columns, self.config["augmentation"], self.rng, WARP[stage])
        images, truth = made.images.to(self.device), batch.attributes.to(self.device)
        self.set_rate(fraction)
        with torch.autocast(self.device, torch.bfloat16):
            words = self.words() if self.progress.steps % WORD_STEPS[stage] == 0 or not self.said else self.said
            self.said = [w.detach() for w in words]
            captions = self.encode(self.templated(batch.captions)) if stage > 1 else None
            if stage == 3 and self.progress.steps % ATTACK_STEPS == 0:
                images = self.attack(images, batch, words, captions, truth)
            parts, stages = self.tower_losses(images, batch, words, captions, truth)
            if stage > 1:
                parts["masks"] = self.mask_part(stages, batch, rows, columns, made)
            loss = self.total(parts)
        optimisers = (self.muon, self.optimiser)
        for optimiser in optimisers:
            optimiser.zero_grad()
        loss.backward()
        parameters = [p for o in optimisers for g in o.param_groups for p in g["params"]]
        norm = nn.utils.clip_grad_norm_(parameters, 50.0)
        if bool(torch.isfinite(norm)):
            for optimiser in optimisers:
                optimiser.step()
        self.advance(count * (self.workers.count if self.workers is not None else 1), parameters)
        values = {k: float(v.detach()) for k, v in parts.items()}
        for k, v in values.items():
            self.recent[k] = 0.95 * self.recent.get(k, v) + 0.05 * v
        return values

    def attack(
        self, images: Tensor, batch: Batch, words: list[Tensor], captions: Tensor | None, truth: Tensor
    ) -> Tensor:
        images = images.requires_grad_()
        parts, _ = self.tower_losses(
            images, batch, [w.detach() for w in words], None if captions is None else captions.detach(), truth
        )
        gradient = torch.autograd.grad(self.total(parts), images)[0]
        return adversarial(images.detach(), gradient.float(), self.rng)

    def mask_part(self, stages: list[Tensor], batch: Batch, rows: Tensor, columns: Tensor, made: Augmented) -> Tensor:
        share = DECODER_SHARE[self.progress.stage]
        texts = [batch.queries[r][c] for r, c in zip(rows.tolist(), columns.tolist(), strict=True)]
        place = {t: i for i, t in enumerate(dict.fromkeys(texts))}
        text = gradient_share(self.encode(list(place)), share)[[place[t] for t in texts]]
        stages = [gradient_share(s, share) for s in stages]
        logits = self.model.decoder(stages, text, rows.to(self.device))[:, None].float()
        size = made.images.shape[-1]
        logits = F.interpolate(logits, (size, size), mode="bilinear", align_corners=False)[:, 0]
        return losses.mask_loss(
            logits,
            made.masks.to(self.device),
            made.valid[rows].to(self.device),
            batch.kinds[rows, columns].to(self.device),
        )

    # ---- bookkeeping ----------------------------------------------------------------------------------------------

    def set_rate(self, fraction: float) -> None:
        fraction = min(1.0, fraction)
        share = min(1.0, (self.progress.stage_steps + 1) / WARM_UP)
        if self.progress.stage == 2:
            share *= 0.7 - 0.4 * fraction
        elif self.progress.stage == 3:
            share *= 0.3 * (0.02 + 0.98 * 0.5 * (1 + math.cos(math.pi * fraction)))
        for group in self.muon.param_groups:
            group["lr"] = MUON_RATE * share * self.rate / RATE
        for group in self.optimiser.param_groups:
            group["lr"] = self.rate * share * group["share"]

    def advance(self, count: int, parameters: list[Tensor]) -> None:
        self.progress.steps += 1
        self.progress.stage_steps += 1
        self.progress.pictures += count
        if self.workers is None:
            self.stop = self.wish
        if self.progress.steps % MEETING == 0:
            if self.workers is not None:
                statistics = [b for b in self.model.buffers() if b.is_floating_point()]
                self.stop = self.workers.average([p.data for p in parameters] + statistics, self.wish)
            keep = min(AVERAGE, (self.progress.steps + 1) / (self.progress.steps + 40)) ** MEETING
            with torch.no_grad():
                for k, v in self.model.state_dict().items():
                    self.average[k].lerp_(v.float(), 1 - keep)

    def averaged(self) -> Guidance:
        """The averaged model, for evaluation and export."""
        model = Guidance(self.config)
        model.load_state_dict(self.average)
        return model.to(memory_format=torch.channels_last).eval()

    def save(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_name(path.name + ".part")
        torch.save(
            {
                "config": self.config,
                "model": self.model.state_dict(),
                "heads": self.heads.state_dict(),
                "word_scale": self.word_scale.detach(),
                "optimiser": self.optimiser.state_dict(),
                "muon": self.muon.state_dict(),
                "average": self.average,
                "progress": vars(self.progress),
                "rng": self.rng.get_state(),
                "saved": time.time(),
            },
            part,
        )
        os.replace(part, path)

    def restore(self, path: Path) -> None:
        saved = torch.load(path, map_location=self.device, weights_only=True)
        self.heads.load_state_dict(saved["heads"])
        self.word_scale.data.copy_(saved["word_scale"])
        if saved["config"]["vision_config"]["layers"] == self.config["vision_config"]["layers"]:
            self.model.load_state_dict(saved["model"])
            self.optimiser.load_state_dict(saved["optimiser"])
            self.muon.load_state_dict(saved["muon"])
            self.average = {k: v.float() for k, v in saved["average"].items()}
        else:
            self.grow(saved["model"])
        self.progress = Progress(**saved["progress"])
        self.rng.set_state(saved["rng"].cpu())

    def adopt(self, other: Guidance) -> None:
        """Start from another model's weights (a shipped folder); the optimiser and the heads start afresh."""
        self.grow(other.state_dict())

    def grow(self, weights: dict[str, Tensor]) -> None:
        """Weights of a trunk with as many blocks or fewer: the blocks it lacks start as the identity (their last
        scale is 0), so the larger network computes what the smaller did."""
        missing, unexpected = self.model.load_state_dict(weights, strict=False)
        if unexpected:
            raise ValueError(f"the trunk has no place for {unexpected[0]}: it can grow, not shrink")
        with torch.no_grad():
            for name in missing:
                if name.endswith("bn3.weight"):
                    self.model.get_parameter(name).zero_()
        self.average = {k: v.detach().clone().float() for k, v in self.model.state_dict().items()}
