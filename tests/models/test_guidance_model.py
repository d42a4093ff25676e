"""The guidance model: losses in closed form, the tokenizer's round trip, a step of each stage, the shipped weights."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from torch import nn

sys.path[:0] = [str(Path(__file__).resolve().parents[2] / "models"), str(Path(__file__).resolve().parent)]

import data  # noqa: E402
import losses  # noqa: E402
import stand_in  # noqa: E402
from evaluate import evaluate, heldout_generator  # noqa: E402
from folder import MAX_BYTES, load_folder, mean_weights, save_folder  # noqa: E402
from muon import Muon, nearly_orthogonal  # noqa: E402
from network import CONTEXT_LENGTH, GatheredConv, Guidance, PointConv, default_config, unit  # noqa: E402
from tokenizer import CaptionTokenizer  # noqa: E402
from trainer import MAX_RADIUS, Trainer, adversarial  # noqa: E402

MODELS = data.ROOT / "models"
CAPTIONS = [
    "a red ball",
    "a golden chair without back",
    "a yellow bulldozer with black tracks",
    "polka-dotted mug",
    "the cat's hat",
    "snow on a house",
    "a photo of two blue cubes",
]
NETWORK = {
    "width": 32,
    "layers": (1, 1, 1, 1),
    "stem_pool": True,
    "dim": 64,
    "text_width": 64,
    "text_layers": 1,
    "reduce_dim": 16,
}


def eye(n: int, d: int) -> torch.Tensor:
    return torch.eye(d)[:n]


# ---- losses -----------------------------------------------------------------------------------------------------


def test_attribute_loss_is_cross_entropy_over_the_words_and_skips_the_unsaid() -> None:
    images, words, scale = eye(2, 4), [eye(3, 4), eye(2, 4)], torch.tensor(5.0)
    truth = torch.tensor([[0, -1], [2, 1]])
    # Attribute 0: picture 0 is its own word, picture 1 is word 1 but should be 2. Attribute 1: only picture 1 counts.
    own, other = math.exp(5) / (math.exp(5) + 2), 1 / (math.exp(5) + 2)
    expected = -(math.log(own) + math.log(other)) / 2 - math.log(math.exp(5) / (math.exp(5) + 1))
    assert float(losses.attribute_loss(images, words, truth, scale)) == pytest.approx(expected, rel=1e-5)


def test_what_training_never_shows_is_no_alternative() -> None:
    # 2 shapes, 2 materials (the second takes no colour), 3 colours. Kept out: (0, 0, colour 2), (1, 1, no colour).
    kept = {(0, 0, 2), (1, 1, -1)}
    held_out = losses.HeldOut(lambda *c: c in kept, [True, False], [2, 2, 3])
    truth = torch.tensor([[0, 0, 1], [1, 0, 2], [0, 1, -1], [0, 0, 2]])
    shape, material, colour = held_out.never_shown(truth)
    # Picture 0 may not say that its colour is not 2; picture 1 (shape 1 in colour 2) that it is not shape 0, nor that
    # it is not of material 1; picture 2 (material 1) that it is not shape 1; a kept picture itself keeps its own words.
    assert shape.tolist() == [[False, False], [True, False], [False, True], [False, False]]
    assert material.tolist() == [[False, False], [False, True], [False, False], [False, False]]
    assert colour.tolist() == [[False, False, True], [False] * 3, [False] * 3, [False] * 3]

    # Words of another object in view are no alternatives either, but a picture's own word stays.
    beside = torch.tensor([[0b11, 0, 0b001], [0, 0, 0], [0, 0b01, 0], [0, 0, 0b100]])
    with_neighbours = held_out.never_wrong(truth, beside)
    assert with_neighbours[0].tolist() == [[False, True], [True, False], [False, True], [False, False]]
    assert with_neighbours[1].tolist() == [[False, False], [False, True], [True, False], [False, False]]
    assert with_neighbours[2].tolist() == [[True, False, True], [False] * 3, [False] * 3, [False] * 3]

    logits = [torch.zeros(4, k, requires_grad=True) for k in (2, 2, 3)]
    loss = losses.head_loss(logits, truth, [shape, material, colour])
    assert loss.item() == pytest.approx(2 / 4 * math.log(2) + 3 / 4 * math.log(2) + (math.log(2) + 2 * math.log(3)) / 3)
    loss.backward()
    for x, never in zip(logits, (shape, material, colour), strict=True):
        assert x.grad is not None and bool((x.grad[never] == 0).all()) and bool((x.grad[0][~never[0]] != 0).any())


def test_contrastive_loss_ignores_captions_that_may_be_true_of_both() -> None:
    images = texts = eye(4, 4)
    scale, captions = torch.tensor(3.0), ["red", "blue", "red ball", "green"]
    distinct = torch.tensor([[0], [1], [2], [3]])
    full = -math.log(math.exp(3) / (math.exp(3) + 3))
    assert float(losses.contrastive_loss(images, texts, distinct, captions, scale)) == pytest.approx(full, rel=1e-5)
    # Rows 0 and 2 agree: neither is the other's negative, so they have two negatives left, the others keep three.
    agreeing = torch.tensor([[0], [1], [0], [3]])
    fewer = -math.log(math.exp(3) / (math.exp(3) + 2))
    got = float(losses.contrastive_loss(images, texts, agreeing, captions, scale))
    assert got == pytest.approx((2 * full + 2 * fewer) / 4, rel=1e-5)
    # Twins (rows 0 and 1) stay negatives of each other even where the truth leaves it open.
    twins = torch.tensor([[-1], [1], [2], [3]])
    got = float(losses.contrastive_loss(images, texts, twins, captions, scale))
    alone = -math.log(math.exp(3) / (math.exp(3) + 1))
    assert got == pytest.approx((alone + full + 2 * fewer) / 4, rel=1e-5)
    # Picture 3 with caption 0's word is a combination kept out of training: one negative less for each of the two.
    never = [torch.zeros(4, 4, dtype=torch.bool)]
    never[0][3, 0] = True
    got = float(losses.contrastive_loss(images, texts, distinct, captions, scale, never))
    assert got == pytest.approx((3 * full + fewer) / 8 + (3 * full + fewer) / 8, rel=1e-5)


def test_which_captions_say_what_training_never_shows() -> None:
    never = [torch.tensor([[True, False], [False, False]]), torch.tensor([[False, False, False], [False, False, True]])]
    said = torch.tensor([[0, -1], [-1, 2]])
    assert losses.says_never_shown(never, said).tolist() == [[True, False], [False, True]]
    # A word left unsaid excuses nothing.
    assert not losses.says_never_shown(never, torch.full((2, 2), -1)).any()


def test_direction_loss_is_zero_pull_for_parallel_changes_and_finite_for_equal_twins() -> None:
    images = torch.stack([eye(4, 4)[i] for i in range(4)])
    captions = ["red ball", "blue ball", "cube", "cone"]
    aligned = float(losses.direction_loss(images, images, captions))
    turned = float(losses.direction_loss(images, images[[1, 0, 3, 2]], captions))
    assert aligned == pytest.approx(-math.log(math.exp(10) / (math.exp(10) + 1)), abs=2e-3)
    assert turned > 10
    still = torch.ones(4, 4, requires_grad=True)
    losses.direction_loss(unit(still), images, captions).backward()
    assert torch.isfinite(still.grad).all()


def test_equal_changes_are_recognised_by_their_words() -> None:
    keys = losses.change_keys(["a red ball", "a blue ball", "red cube on fire", "blue cube on fire", "cup", "mug"])
    assert keys[0] == keys[1] == (frozenset({"red"}), frozenset({"blue"})) and keys[2] != keys[0]


def test_mask_loss_closed_forms() -> None:
    valid = torch.ones(1, 4, 4, dtype=torch.bool)
    empty = torch.zeros(1, 4, 4, dtype=torch.bool)
    half = empty.clone()
    half[:, :2] = True
    zero = torch.zeros(1, 4, 4)

    def loss(logits: torch.Tensor, mask: torch.Tensor, kind: int) -> float:
        return float(losses.mask_loss(logits, mask, valid, torch.tensor([kind])))

    assert loss(zero, empty, losses.PHOTO) == pytest.approx(0, abs=1e-6)
    assert loss(zero + 2, empty, losses.PHOTO) == pytest.approx(math.log(1 + math.exp(2)) - 1 - math.log(2), abs=1e-5)
    top = math.log(1 + math.exp(losses.MARGIN))
    assert loss(zero, empty, losses.ABSENT) == pytest.approx(3 * math.log(2) + 0.5 * top, rel=1e-5)
    # One sure pixel of 16 is what the surest percent (at least one pixel) looks at.
    spot = zero.clone() - 30
    spot[0, 1, 2] = 6
    expected = 3 * math.log(1 + math.exp(6)) / 16 + 0.5 * math.log(1 + math.exp(6 + losses.MARGIN))
    assert loss(spot, empty, losses.ABSENT) == pytest.approx(expected, rel=1e-5)
    # Logit 0 everywhere, half of the picture marked: plain + 0.5 inside + Dice with its +1.
    dice = 1 - (2 * 4 + 1) / (8 + 8 + 1)
    assert loss(zero, half, losses.OBJECT) == pytest.approx(1.5 * math.log(2) + dice, rel=1e-5)
    sure = torch.where(half, 20.0, -20.0)
    assert loss(sure, half, losses.OBJECT) < 1e-3 < loss(-sure, half, losses.OBJECT)


def test_adversarial_step_stays_in_its_ball_and_in_range() -> None:
    rng = torch.Generator().manual_seed(0)
    images = torch.rand(8, 3, 16, 16, generator=rng)
    gradient = torch.randn(8, 3, 16, 16, generator=rng)
    moved = adversarial(images, gradient, rng)
    length = (moved - images).flatten(1).norm(dim=1)
    assert float(length.max()) <= MAX_RADIUS + 1e-5 and float(length.max()) > 0.1
    assert float(moved.min()) >= 0 and float(moved.max()) <= 1


def test_muon_steps_are_nearly_orthogonal_and_descend() -> None:
    torch.manual_seed(0)
    for shape in ((32, 128), (128, 32)):
        values = torch.linalg.svdvals(nearly_orthogonal(torch.randn(shape)))
        assert 0.3 < float(values.min()) and float(values.max()) < 1.3
    weight = nn.Conv2d(8, 16, 3, bias=False).weight
    target = torch.randn_like(weight)
    optimiser = Muon([weight], lr=0.02)
    first = float((weight - target).detach().square().mean())
    for _ in range(300):
        optimiser.zero_grad()
        (weight - target).square().mean().backward()
        optimiser.step()
    assert float((weight - target).detach().square().mean()) < 0.6 * first


@pytest.mark.parametrize("conv", [PointConv(16, 32), GatheredConv(16, 32)])
def test_convolutions_as_matrix_products_are_convolutions(conv: nn.Conv2d) -> None:
    x = torch.randn(3, 16, 5, 4, requires_grad=True)
    peer = nn.functional.conv2d(x, conv.weight, padding=conv.padding)
    grad = torch.randn_like(peer)
    want = torch.autograd.grad(peer, (x, conv.weight), grad)
    got = torch.autograd.grad(conv(x), (x, conv.weight), grad)
    assert torch.allclose(conv(x), peer, atol=1e-5)
    assert all(torch.allclose(a, b, atol=1e-4) for a, b in zip(got, want, strict=True))


# ---- pictures ---------------------------------------------------------------------------------------------------


def test_augmentation_without_warp_or_jitter_keeps_the_picture_and_moves_masks_alike() -> None:
    batch = data.to_batch(stand_in.Generator(3).batch(6))
    still = data.warp_grid(torch.eye(3).repeat(12, 1, 1), 64)
    images = batch.images.float() / 255
    same = torch.nn.functional.grid_sample(images, still, mode="bilinear", align_corners=False)
    assert float((same - images).abs().max()) < 1e-5
    rows, columns = torch.arange(12), torch.zeros(12, dtype=torch.int64)
    none = {"brightness": 0.0, "contrast": 0.0, "saturation": 0.0}
    made = data.augment(batch, rows, columns, none, torch.Generator().manual_seed(1))
    for i in range(12):  # the painted thing is never white, so a mask pixel is never white either (edges are mixed)
        inside = made.masks[i] & made.valid[i]
        inner = inside & (torch.nn.functional.avg_pool2d(inside[None].float(), 7, 1, 3)[0] > 0.99)
        if inner.any():
            assert float(made.images[i].min(0).values[inner].max()) < 0.6


def test_single_pictures_come_about_twice_and_keep_their_attributes() -> None:
    stream = data.Stream(stand_in.Generator(3), 24)
    singles = data.Singles(stream, 48, torch.Generator().manual_seed(1))
    drawn = [next(singles) for _ in range(60)]
    stream.close()
    colours = torch.tensor(stand_in.PAINT).float()
    for batch in (drawn[0], drawn[-1]):
        assert batch.images.shape == (48, 3, 64, 64) and batch.attributes.shape == (48, 3)
        for image, truth in zip(batch.images.float(), batch.attributes, strict=True):
            painted = (image - colours[truth[2]].view(3, 1, 1)).abs().amax(0) < 1
            assert int(painted.sum()) > 100
    keys = [i.numpy().tobytes() for b in drawn for i in b.images]
    assert 1.2 < len(keys) / len(set(keys)) < 4


def test_a_stream_repeats_a_batch_once() -> None:
    stream = data.Stream(stand_in.Generator(3), 2)
    batches = [next(stream) for _ in range(3 * data.Stream.KEPT)]
    stream.close()
    seen = [id(b) for b in batches]
    assert max(seen.count(i) for i in set(seen)) == 2
    assert len(set(seen)) == 2 * data.Stream.KEPT


def test_lessons_lead_from_easy_to_the_held_out_difficulty() -> None:
    import generator_build

    full = json.loads((generator_build.SOURCES / "heldout_settings.json").read_text())
    start, half = json.loads(data.lesson(0)), json.loads(data.lesson(0.5))
    assert start == data.EASY | data.TRUE_CAPTIONS and json.loads(data.lesson(1)) == data.TRUE_CAPTIONS
    assert all(half[k] == pytest.approx((start[k] + full[k]) / 2) for k in data.EASY)


# ---- tokenizer --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def tokenizer() -> CaptionTokenizer:
    return CaptionTokenizer.train(CAPTIONS * 3, CONTEXT_LENGTH)


def test_tokenizer_round_trip_and_clip_layout(tokenizer: CaptionTokenizer, tmp_path: Path) -> None:
    from transformers import CLIPTokenizer

    tokenizer.save(tmp_path)
    loaded, peer = CaptionTokenizer.load(tmp_path, CONTEXT_LENGTH), CLIPTokenizer.from_pretrained(tmp_path)
    odd = ["A  RED\tball!", "", "unseen zebras", "caf\u00e9 \u2603 42", "it's", "x" * 20]
    for text in CAPTIONS + odd:
        assert tokenizer.ids(text) == loaded.ids(text) == peer(text)["input_ids"], text
    assert loaded.words == tokenizer.words and {"bulldozer", "golden"} <= loaded.words
    assert loaded.decode(loaded.ids("a red ball")) == "a red ball"
    assert loaded.end == len(loaded.vocab) - 1 and len(loaded.vocab) <= 4096


def test_long_text_is_cut_and_keeps_its_end_token(tokenizer: CaptionTokenizer) -> None:
    ids = tokenizer(["ball " * 100, "ball"])
    assert ids.shape == (2, CONTEXT_LENGTH) and int(ids[0, -1]) == tokenizer.end
    assert (ids[1, 2:] == tokenizer.end).all()


# ---- network and training steps ---------------------------------------------------------------------------------


def test_padding_does_not_change_a_text_embedding(tokenizer: CaptionTokenizer) -> None:
    torch.manual_seed(0)
    model = Guidance(default_config(vocab_size=len(tokenizer.vocab), **NETWORK)).eval()
    alone = model.encode_text(tokenizer(["a red ball"]))
    padded = model.encode_text(tokenizer(["a red ball", "a photo of two blue cubes with a golden chair"]))
    assert float((alone[0] - padded[0]).abs().max()) < 1e-5


@pytest.mark.parametrize("stem_pool", [True, False])
def test_shapes_and_stage_sizes(tokenizer: CaptionTokenizer, stem_pool: bool) -> None:
    config = default_config(vocab_size=len(tokenizer.vocab), **{**NETWORK, "stem_pool": stem_pool, "stages": (0, 2, 4)})
    model = Guidance(config).eval()
    embeddings, stages = model.visual(model.preprocess(torch.rand(2, 3, 64, 64)))
    sides = [32, 16, 8, 4, 2] if stem_pool else [32, 32, 16, 8, 4]
    assert embeddings.shape == (2, 64) and [s.shape[-1] for s in stages] == sides
    assert [s.shape[1] for s in stages] == [32, 128, 256, 512, 1024]
    text = unit(model.encode_text(tokenizer(["ball", "cube", "hat"])))
    assert model.segment(torch.rand(2, 3, 64, 64), text, torch.tensor([0, 0, 1])).shape == (3, 64, 64)


def test_every_stage_learns_on_a_few_squares_and_discs_and_survives_a_folder(tmp_path: Path) -> None:
    torch.set_num_threads(1)
    generator = stand_in.Generator(5)
    vocabulary = generator.vocabulary()
    captions = [c for pair in generator.batch(64)["captions"] for c in pair] + ["photo", "ground", "plastic striped"]
    tokenizer = CaptionTokenizer.train(captions, CONTEXT_LENGTH)
    held_out = losses.HeldOut(lambda *_: False, [True, True], [2, 2, 3])
    config = default_config(vocab_size=len(tokenizer.vocab), **NETWORK)
    trainer = Trainer(config, tokenizer, vocabulary, held_out, seed=1)
    first, last = {}, {}
    for stage, steps in ((1, 24), (2, 8), (3, 3)):
        trainer.progress.stage, trainer.progress.stage_steps = stage, 30
        for _ in range(steps):
            values = trainer.step(data.to_batch(generator.batch(12)), 0.5)
            assert all(math.isfinite(v) for v in values.values()), values
            first.setdefault(stage, values)
            last[stage] = values
    assert last[1]["heads"] < 0.8 * first[1]["heads"], (first[1], last[1])
    assert set(last[3]) >= {"heads", "captions", "twins", "masks"}
    trainer.save(tmp_path / "latest.pt")
    again = Trainer(trainer.config, tokenizer, vocabulary, held_out, seed=9)
    again.restore(tmp_path / "latest.pt")
    assert vars(again.progress) == vars(trainer.progress)
    size = save_folder(tmp_path / "folder", trainer.config, trainer.averaged().state_dict(), tokenizer)
    model, loaded = load_folder(tmp_path / "folder")
    images = torch.rand(2, 3, 64, 64)
    with torch.no_grad():
        exact, shipped = trainer.averaged().encode_image(images), model.encode_image(images)
    assert size < MAX_BYTES and loaded.vocab == tokenizer.vocab
    assert float((unit(exact) - unit(shipped)).abs().max()) < 5e-3


def test_mean_weights() -> None:
    first = {"a": torch.tensor([1.0, 3.0]), "count": torch.tensor(7)}
    second = {"a": torch.tensor([2.0, -3.0], dtype=torch.float16), "count": torch.tensor(9)}
    mean = mean_weights(first, second)
    assert mean["a"].tolist() == [1.5, 0.0] and int(mean["count"]) == 7
    with pytest.raises(ValueError, match="one network"):
        mean_weights(first, {"a": torch.zeros(3), "count": torch.tensor(1)})


# ---- what is shipped --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["guide", "judge"])
def test_shipped_figures_hold_on_a_small_held_out_set(name: str) -> None:
    folder = MODELS / name
    if not (folder / "figures.json").exists():
        pytest.skip(f"models/{name} is not in this checkout: models/train.py makes it")
    stated = json.loads((folder / "figures.json").read_text())
    assert (folder / "model.safetensors").stat().st_size <= MAX_BYTES
    torch.set_num_threads(1)
    model, tokenizer = load_folder(folder)
    figures, _ = evaluate(model, tokenizer, heldout_generator(seed=4242), 256)
    told = ("shape_told", "material_told", "colour_told")
    for key in ("shape", "material", "colour", *told, "iou_objects", "iou_ground", "absent_left_empty"):
        # Three standard errors of a share over the fewest queries or pictures that count (about 60).
        count = 60 if key.startswith("iou") or key in told else 120
        margin = 3 * math.sqrt(max(stated[key] * (1 - stated[key]), 0.02) / count)
        assert figures[key] >= stated[key] - margin, f"{name}: {key} is {figures[key]:.3f}, the card says {stated[key]}"


def test_a_minute_and_a_half_of_training_beats_chance(tmp_path: Path) -> None:
    # In one minute a busy machine now and then did not get far enough with shapes.
    command = [sys.executable, str(MODELS / "train.py"), "--smoke", "--minutes", "1.5", "--checkpoints", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=280)
    assert done.returncode == 0, (done.stdout + done.stderr)[-2000:]
    assert json.loads(done.stdout.splitlines()[-1])["event"] == "done"
