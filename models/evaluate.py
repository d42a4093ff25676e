"""Held-out figures of a guidance folder, and its model card.

    python models/evaluate.py models/guide [--pictures 4096] [--split heldout] [--card]
    python models/evaluate.py models/guide --favour      does it favour held-out words, or shun them? (see `favour`)

Recognition is zero-shot by text: a picture's class is the word with the largest cosine, the word's embedding averaged
over `WORD_TEMPLATES`; a picture counts for an attribute only when its caption states it. Segmentation: a pixel
belongs to the query when its logit exceeds that of "photo"; IoU is the mean over queries whose thing shows at least
`MIN_PIXELS` pixels; an absent query counts as left empty when at most 1 % of the picture's pixels are marked.
The combinations of the "heldout" split (shape, material, colour) never occur in training.
The test's captions say what the scene is, whether or not the picture shows it ("a blue stool" whose visible parts are
all of other colours; the smaller of two things side by side), and its settings are frozen. So each attribute is also
counted over the pictures that can tell it (`told`): the main object fills a twentieth of the picture and three
quarters of what is seen of all objects, and half of what is seen of it is painted in the colour (and not under rust,
moss, snow or fire) or made of the material in question.
`shape_alone` and `colour_alone` count pictures of one plain object with nothing beside it.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import torch
from data import ROOT, Batch, load_generator_module, read_settings, to_batch
from folder import load_folder
from losses import ABSENT, ADDITION, ATTRIBUTE, GROUND, OBJECT, PART, HeldOut
from network import Guidance, unit
from tokenizer import CaptionTokenizer, write_text
from torch import Tensor

WORD_TEMPLATES = {
    "shapes": ("{}", "a {}", "a photo of a {}", "a small {}"),
    "materials": ("{}", "a {} thing", "a {} object", "something {}"),
    "colours": ("{}", "a {} thing", "a {} object", "something {}"),
}
SAID = {"plain": "plastic"}  # the vocabulary's name -> the word that captions use
MIN_PIXELS = 12
TOLD = {"picture": 0.05, "objects": 0.75, "attribute": 0.5}  # least shares for a picture to tell its words
COVERS = {"rusty", "mossy", "snow-covered", "burning"}
EMPTY_SHARE = 0.01
KIND_NAMES = {OBJECT: "objects", PART: "parts", GROUND: "ground", ATTRIBUTE: "attributes", ADDITION: "additions"}


def article(text: str) -> str:
    """ "a orange ball" -> "an orange ball"."""
    words = text.split(" ")
    pairs = zip(words, [*words[1:], ""], strict=True)
    return " ".join("an" if w == "a" and n[:1] in tuple("aeiou") else w for w, n in pairs)


def word_prompts(vocabulary: dict[str, list[str]], attribute: str, template: str) -> list[str]:
    return [article(template.format(SAID.get(w, w))) for w in vocabulary[attribute]]


def word_embeddings(model: Guidance, tokenizer: CaptionTokenizer, vocabulary: dict[str, list[str]]) -> list[Tensor]:
    """For shapes, materials, colours: K x D unit embeddings averaged over the templates."""
    result = []
    for attribute, templates in WORD_TEMPLATES.items():
        each = [unit(model.encode_text(tokenizer(word_prompts(vocabulary, attribute, t)))) for t in templates]
        result.append(unit(torch.stack(each).mean(0)))
    return result


class Recognition:
    """Counts of truth against guess for one attribute."""

    def __init__(self, names: list[str]) -> None:
        self.names, self.counts = names, torch.zeros(len(names), len(names), dtype=torch.int64)

    def add(self, scores: Tensor, truth: Tensor) -> None:
        known = truth >= 0
        for t, g in zip(truth[known].tolist(), scores[known].argmax(-1).tolist(), strict=True):
            self.counts[t, g] += 1

    def accuracy(self) -> float:
        return float(self.counts.diagonal().sum() / self.counts.sum().clamp_min(1))

    def table(self) -> str:
        """Each word: how many, how many right, and what it is most often taken for."""
        lines = ["| word | pictures | right | most often taken for |", "|---|---|---|---|"]
        for i, name in enumerate(self.names):
            row = self.counts[i].clone()
            total, right = int(row.sum()), int(row[i])
            row[i] = 0
            others = [f"{self.names[j]} {int(row[j])}" for j in row.argsort(descending=True)[:3].tolist() if row[j] > 0]
            if total:
                lines.append(f"| {name} | {total} | {right / total:.0%} | {', '.join(others)} |")
        return "\n".join(lines)


class Masks:
    """Sums of IoU by kind of query, and the share of absent queries left empty."""

    def __init__(self) -> None:
        self.iou: dict[int, list[float]] = {k: [] for k in KIND_NAMES}
        self.empty: list[bool] = []

    def add(self, marked: Tensor, masks: Tensor, kinds: Tensor) -> None:
        both = (marked & masks).sum((1, 2))
        either = (marked | masks).sum((1, 2)).clamp_min(1)
        area = masks.sum((1, 2))
        for i, kind in enumerate(kinds.tolist()):
            if kind == ABSENT:
                self.empty.append(bool(marked[i].float().mean() <= EMPTY_SHARE))
            elif kind in self.iou and area[i] >= MIN_PIXELS:
                self.iou[kind].append(float(both[i] / either[i]))

    def figures(self) -> dict[str, float]:
        result = {f"iou_{KIND_NAMES[k]}": sum(v) / len(v) for k, v in self.iou.items() if v}
        if self.empty:
            result["absent_left_empty"] = sum(self.empty) / len(self.empty)
        return result


@torch.no_grad()
def add_batch(
    model: Guidance,
    tokenizer: CaptionTokenizer,
    batch: Batch,
    subsets: dict[str, tuple[int, Tensor]],
    words: list[Tensor],
    seen: list[Recognition],
    in_subset: dict[str, Recognition],
    masks: Masks,
    moves: list[float],
) -> None:
    """Adds one batch's counts to `seen`, `in_subset` (an attribute on some of the pictures), `masks` and `moves`."""
    images = batch.images.float() / 255
    embeddings, stages = model.visual(model.preprocess(images))
    embeddings = unit(embeddings.float())
    for column, recognition in enumerate(seen):
        recognition.add(embeddings @ words[column].T, batch.attributes[:, column])
    for name, (column, some) in subsets.items():
        in_subset[name].add(embeddings[some] @ words[column].T, batch.attributes[some, column])
    said = unit(model.encode_text(tokenizer(batch.captions)))
    moved, told = unit(embeddings[::2] - embeddings[1::2], 1e-2), unit(said[::2] - said[1::2], 1e-2)
    moves.extend((moved * told).sum(-1).tolist())
    texts = sorted({q for row in batch.queries for q in row} | {"photo"})
    place = {t: i for i, t in enumerate(texts)}
    text = unit(model.encode_text(tokenizer(texts)))
    size = images.shape[-1]

    def logits(index: Tensor) -> Tensor:
        out = model.decoder(stages, text[index], torch.arange(len(index)))[:, None].float()
        return torch.nn.functional.interpolate(out, (size, size), mode="bilinear", align_corners=False)[:, 0]

    neutral = logits(torch.full((len(images),), place["photo"]))
    for q in range(batch.kinds.shape[1]):
        asked = logits(torch.tensor([place[row[q]] for row in batch.queries]))
        masks.add(asked > neutral, batch.masks[:, q].bool(), batch.kinds[:, q])


def subsets_of(raw: dict[str, Any]) -> dict[str, tuple[int, Tensor]]:
    """Figures that count only some of a generated batch's pictures: the attribute's column, and which pictures."""
    objects = [json.loads(spec)["objects"] for pair in raw["spec"] for spec in pair]
    plain = torch.tensor([o[0]["material"] == "plain" for o in objects])
    alone = torch.tensor([len(o) == 1 for o in objects]) & plain
    of_picture, of_objects, colour, material = torch.from_numpy(raw["shares"]).flatten(0, 1).unbind(1)
    bare = torch.tensor([o[0]["material"] not in COVERS for o in objects])
    told = (of_picture >= TOLD["picture"]) & (of_objects >= TOLD["objects"])
    return {
        "shape_told": (0, told),
        "material_told": (1, told & (material >= TOLD["attribute"])),
        "colour_told": (2, told & bare & (colour >= TOLD["attribute"])),
        "shape_alone": (0, alone),
        "colour_alone": (2, alone),
    }


def evaluate(
    model: Guidance, tokenizer: CaptionTokenizer, generator: Any, pictures: int, pairs: int = 32
) -> tuple[dict[str, float], list[Recognition]]:
    """Figures by name (shares in [0, 1]) over at least `pictures` pictures of the generator, and the confusions."""
    was_training = model.training
    model.eval()
    vocabulary = generator.vocabulary()
    with torch.no_grad():
        words = word_embeddings(model, tokenizer, vocabulary)
    names = [list(vocabulary[a]) for a in WORD_TEMPLATES]
    seen, in_subset = [Recognition(n) for n in names], {}
    masks, moves = Masks(), []
    done = 0
    while done < pictures:
        raw = generator.batch(pairs, threads=1)
        subsets = subsets_of(raw)
        in_subset = in_subset or {name: Recognition(names[column]) for name, (column, _) in subsets.items()}
        add_batch(model, tokenizer, to_batch(raw), subsets, words, seen, in_subset, masks, moves)
        done += 2 * pairs
    model.train(was_training)
    figures = {name: r.accuracy() for name, r in zip(("shape", "material", "colour"), seen, strict=True)}
    figures |= {name: recognition.accuracy() for name, recognition in in_subset.items()}
    figures.update(masks.figures())
    figures["direction_cosine"] = sum(moves) / len(moves)
    return figures, seen


@torch.no_grad()
def favour(
    model: Guidance, tokenizer: CaptionTokenizer, generator: Any, held_out: HeldOut, pictures: int
) -> dict[str, float]:
    """On pictures of trained combinations: how often a wrong answer names a word that would make a held-out one, over
    how often it would by chance. Above 1 the model favours what training never called wrong (and held-out figures
    flatter it), below 1 it has learnt that such things do not exist."""
    model.eval()
    words = word_embeddings(model, tokenizer, generator.vocabulary())
    named, chance = [0.0] * len(words), [0.0] * len(words)
    for _ in range(0, pictures, 64):
        batch = to_batch(generator.batch(32))
        seen = unit(model.visual(model.preprocess(batch.images.float() / 255))[0].float())
        for i, never in enumerate(held_out.never_shown(batch.truth)):
            guess = (seen @ words[i].T).argmax(1)
            wrong = (batch.attributes[:, i] >= 0) & (guess != batch.attributes[:, i])
            named[i] += float(never[wrong, guess[wrong]].sum())
            chance[i] += float((never[wrong].sum(1) / (never.shape[1] - 1)).sum())
    return {f"favour_{a}": n / max(c, 1e-9) for a, n, c in zip(WORD_TEMPLATES, named, chance, strict=True)}


def heldout_generator(split: str = "heldout", seed: int = 20261) -> Any:
    """The frozen held-out test: its settings file is fixed by a hash in the repository."""
    settings = ROOT / "models" / "generator" / "heldout_settings.json"
    text = read_settings(settings) if settings.exists() else ""
    return load_generator_module().Generator(seed=seed, split=split, size=64, settings=text)


TARGETS = {
    "colour": 0.92,
    "material": 0.80,
    "shape": 0.85,
    "colour_told": 0.92,
    "material_told": 0.80,
    "shape_told": 0.85,
    "iou_objects": 0.65,
    "iou_parts": 0.40,
    "iou_ground": 0.40,
    "absent_left_empty": 0.85,
}


def card(
    name: str,
    config: dict[str, Any],
    figures: dict[str, float],
    seen: list[Recognition],
    history: str,
    pictures: int,
    vocabulary: dict[str, list[str]],
) -> str:
    """The model card: what it is, what it knows, its figures, its confusions."""
    role = (
        "guides edits"
        if name == "guide"
        else "only judges edits (S_CLIP, MP_CLIP); it never guides, and was trained on another split with another seed"
    )
    rows = [f"| {k} | {v:.3f} | {'' if k not in TARGETS else f'{TARGETS[k]:.2f}'} |" for k, v in figures.items()]
    known = "\n".join(f"* {k}: {', '.join(SAID.get(w, w) for w in v)}" for k, v in vocabulary.items())
    titled = zip(("Shapes", "Materials", "Colours"), seen, strict=True)
    tables = "\n\n".join(f"### {n}\n\n{r.table()}" for n, r in titled)
    vision, segmenter = config["vision_config"], config["segmenter_config"]
    return f"""# Built-in guidance model: {name}

A small model of CLIP's form that {role}. Trained by `models/train.py` only on pictures made by `models/generator`
(no photographs, no downloaded weights). It knows the words below and nothing else: for anything beyond them, put
OpenAI's CLIP and CLIPSeg in its place (same folder layout).

Trunk: modified ResNet, width {vision["width"]}, blocks {vision["layers"]}, pictures of {vision["image_size"]} pixels a
side; embeddings of {config["projection_dim"]}; segmenter: FiLM pyramid of width {segmenter["reduce_dim"]}.
{history}

## Figures on held-out combinations

{pictures} generated pictures whose (shape, material, colour) combinations never occur in training; zero-shot by text.
`python models/evaluate.py models/{name} --pictures {pictures}` prints them again.
The test is frozen, and its captions say what a scene is even where the picture does not show it: "a blue stool" with a
pink seat and yellow legs, the smaller of two things side by side. `_told` counts the pictures that can tell: the main
object fills {TOLD["picture"]:.0%} of the picture and {TOLD["objects"]:.0%} of all objects' pixels, and \
{TOLD["attribute"]:.0%} of it shows the colour or material.
`_alone` counts single plain objects with nothing beside them.

| figure | measured | aim |
|---|---|---|
{chr(10).join(rows)}

## What it knows

{known}

## Confusions

{tables}
"""


def write_figures(folder: Path, figures: dict[str, float]) -> None:
    rounded = {k: round(v, 4) for k, v in figures.items()}
    write_text(folder / "figures.json", json.dumps(rounded, indent=1) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--pictures", type=int, default=4096)
    parser.add_argument("--split", default="heldout")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--card", action="store_true", help="write the folder's README.md")
    parser.add_argument("--favour", action="store_true", help="print only that check")
    parser.add_argument("--history", default="", help="a line about the training for the card")
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    model, tokenizer = load_folder(args.folder)
    if args.favour:
        generator = heldout_generator("validation")
        held_out = HeldOut.of(load_generator_module(), generator.vocabulary())
        figures = favour(model, tokenizer, generator, held_out, args.pictures)
        print(json.dumps({k: round(v, 2) for k, v in figures.items()}))
        return
    generator = heldout_generator(args.split)
    figures, seen = evaluate(model, tokenizer, generator, args.pictures)
    print(json.dumps({k: round(v, 4) for k, v in figures.items()}))
    if args.card:
        text = card(args.folder.name, model.config, figures, seen, args.history, args.pictures, generator.vocabulary())
        write_text(args.folder / "README.md", text)
        write_figures(args.folder, figures)


if __name__ == "__main__":
    main()
