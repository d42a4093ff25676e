"""Pictures side by side: what the demo and bench/results.py show."""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image, ImageDraw


def picture(path: Path, size: int) -> Image.Image:
    if not path.exists():
        sys.exit(f"{path} was not written")
    image = Image.open(path).convert("RGBA")
    white = Image.new("RGBA", image.size, (255, 255, 255, 255))
    return Image.alpha_composite(white, image).convert("RGB").resize((size, size), Image.Resampling.LANCZOS)


def edit_map(folder: Path, view: str, size: int) -> Image.Image:
    """The three maps as one picture on black: red added, green changed, blue removed."""
    channels = []
    for name in ("added", "changed", "removed"):
        path = folder / f"{view}_{name}.png"
        channels.append(
            Image.open(path).convert("L").resize((size, size)) if path.exists() else Image.new("L", (size, size))
        )
    return Image.merge("RGB", channels)


def sheet(rows: list[list[Image.Image]], titles: list[str], size: int) -> Image.Image:
    gap, top = 6, 20
    width, height = len(titles) * (size + gap) + gap, top + len(rows) * (size + gap)
    page = Image.new("RGB", (width, height), "white")
    draw = ImageDraw.Draw(page)
    for x, title in enumerate(titles):
        draw.text((gap + x * (size + gap), 4), title, fill="black")
        for y, row in enumerate(rows):
            page.paste(row[x], (gap + x * (size + gap), top + y * (size + gap)))
    return page
