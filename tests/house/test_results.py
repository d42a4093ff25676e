"""The arithmetic of bench/results.py: hues, shares of turned pixels, hand-drawn masks."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

BENCH = Path(__file__).resolve().parents[2] / "bench"
sys.path.insert(0, str(BENCH))

import results  # noqa: E402
import results_page  # noqa: E402


@pytest.mark.parametrize(
    ("colour", "hue"),
    [((1, 0, 0), 0), ((1, 1, 0), 60), ((0, 1, 0), 120), ((0, 0, 1), 240), ((1, 0, 0.5), 330), ((0.8, 0.4, 0.2), 20)],
)
def test_hues(colour: tuple[float, float, float], hue: float) -> None:
    got, strength = results.hue_and_strength(np.array([[colour]], np.float32))
    assert float(got[0, 0]) == pytest.approx(hue, abs=0.01)
    assert float(strength[0, 0]) == pytest.approx(max(colour) - min(colour))


def test_turned_share_counts_only_what_had_the_first_hue(tmp_path: Path) -> None:
    yellow, red, white, blue = (255, 220, 0), (220, 10, 20), (255, 255, 255), (0, 0, 255)
    before = np.array([[yellow, yellow, yellow, white, blue]], np.uint8)
    after = np.array([[red, red, yellow, red, red]], np.uint8)
    for folder, image in (("a", before), ("b", after)):
        (tmp_path / folder).mkdir()
        Image.fromarray(image).save(tmp_path / folder / "v.png")
    share = results.turned_share(tmp_path / "a", tmp_path / "b", ["v"], {"from": [35, 65], "to": [340, 20]})
    assert share == pytest.approx(2 / 3)


@pytest.mark.parametrize(
    ("asked", "share"),
    [
        ({"of": "yellow", "hue": [340, 20]}, 1 / 2),
        ({"of": "changed", "hue": [340, 20]}, 2 / 3),
        ({"of": "object", "white": True}, 1 / 3),
    ],
)
def test_asked_share_counts_inside_the_region(tmp_path: Path, asked: dict, share: float) -> None:
    yellow, red, white, blue = (255, 220, 0), (220, 10, 20), (255, 255, 255), (0, 0, 255)
    before = np.array([[yellow, yellow, white, blue, yellow, yellow]], np.uint8)
    after = np.array([[red, yellow, red, white, red, white]], np.uint8)
    mask = np.array([[255, 255, 255, 255, 0, 0]], np.uint8)
    for name, image in (("a", before), ("b", after), ("m", mask)):
        Image.fromarray(image).save(tmp_path / f"{name}.png")
    got = results.asked_share(tmp_path / "a.png", tmp_path / "b.png", tmp_path / "m.png", asked)
    assert got == pytest.approx(share)
    assert results.asked_share(tmp_path / "a.png", tmp_path / "a.png", tmp_path / "m.png", asked) == 0


def test_regions_are_drawn_and_subtracted(tmp_path: Path) -> None:
    regions = json.loads((BENCH / "lego" / "regions.json").read_text())
    masks = {}
    for name in ("bulldozer", "base plate"):
        view, file = results.draw_mask(regions, name, (400, 400), tmp_path / f"{name}.png").split(":")
        assert view == "r_176"
        masks[name] = np.asarray(Image.open(file)) > 127
    assert not (masks["bulldozer"] & masks["base plate"]).any()
    assert 0.1 < masks["bulldozer"].mean() < 0.4 and 0.1 < masks["base plate"].mean() < 0.4
    assert masks["bulldozer"][150, 300] and masks["base plate"][250, 100]


def test_the_page_shows_the_figures_of_the_file() -> None:
    page, report = results_page.PAGE.read_text(), json.loads(results_page.FIGURES.read_text())
    assert results_page.filled(page, report) == page, "run `python bench/results_page.py`"
    speed_page, speed = results_page.SPEED_PAGE.read_text(), results_page.speed_report()
    assert results_page.filled(speed_page, speed) == speed_page, "run `python bench/results_page.py`"
    accuracy_page, accuracy = results_page.ACCURACY_PAGE.read_text(), results_page.accuracy_report()
    assert results_page.filled(accuracy_page, accuracy) == accuracy_page, "run `python bench/results_page.py`"
    speed["speed"]["render"]["seconds_a_view"]["median"] += 1
    assert results_page.filled(speed_page, speed) != speed_page
    other = json.loads(results_page.FIGURES.read_text())
    other["field"][0]["psnr"] += 1
    assert results_page.filled(page, other) != page
