"""The plot of docs/stability.md: what textbook formulas lose in float32, what ours lose, and what is promised."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

from PIL import Image, ImageDraw, ImageFont

WIDTH, LEFT, RIGHT, TOP, LINE = 1000, 330, 40, 64, 17
LOW, HIGH = 1e-9, 1e2  # what is smaller or larger lies on the edge; at the right one also what is no number
INK, PALE, OURS, TEXTBOOK, BOUND = "#222222", "#dddddd", "#0072b2", "#d55e00", "#777777"
FONT = Path("/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf")


class Canvas:
    """Every mark goes into both pictures."""

    def __init__(self, height: int) -> None:
        self.size = (WIDTH, height)
        self.svg: list[str] = []
        self.image = Image.new("RGB", self.size, "white")
        self.draw = ImageDraw.Draw(self.image)

    def text(self, x: float, y: float, words: str, size: int, color: str = INK, anchor: str = "start") -> None:
        where = f'x="{x:.1f}" y="{y:.1f}" font-size="{size}" fill="{color}" text-anchor="{anchor}"'
        self.svg.append(f"<text {where}>{escape(words)}</text>")
        font = ImageFont.truetype(str(FONT), size) if FONT.exists() else ImageFont.load_default(size)
        side = {"start": "ls", "middle": "ms", "end": "rs"}[anchor]
        self.draw.text((x, y), words, fill=color, font=font, anchor=side)

    def line(self, x0: float, y0: float, x1: float, y1: float, color: str, width: int = 1) -> None:
        self.svg.append(
            f'<path d="M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}" stroke="{color}" stroke-width="{width}" fill="none"/>'
        )
        self.draw.line((x0, y0, x1, y1), fill=color, width=width)

    def cross(self, x: float, y: float, color: str, reach: float = 4) -> None:
        self.line(x - reach, y - reach, x + reach, y + reach, color, 2)
        self.line(x - reach, y + reach, x + reach, y - reach, color, 2)

    def dot(self, x: float, y: float, color: str, radius: float = 4.5) -> None:
        self.svg.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" fill="{color}"/>')
        self.draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=color)

    def write(self, base: Path) -> None:
        head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{self.size[0]}" height="{self.size[1]}" '
        head += 'font-family="DejaVu Sans, sans-serif"><rect width="100%" height="100%" fill="white"/>'
        base.with_suffix(".svg").write_text("\n".join([head, *self.svg, "</svg>\n"]), encoding="utf-8")
        self.image.save(base.with_suffix(".png"), optimize=True)


def place(error: float) -> float:
    share = math.log(min(max(error, LOW), HIGH) / LOW) / math.log(HIGH / LOW)
    return LEFT + (WIDTH - LEFT - RIGHT) * share


def worst_of_paths(rows: list[dict[str, Any]]) -> dict[tuple[str, str, bool], dict[str, Any]]:
    """A line a quantity and part, float32 and bfloat16 apart."""
    lines: dict[tuple[str, str, bool], dict[str, Any]] = {}
    for row in rows:
        line = lines.setdefault((row["quantity"], row["part"], row["path"] == "bfloat16"), dict(row))
        line["ours"] = max(line["ours"], row["ours"])
        line["bound"] = max(line["bound"], row["bound"])
        line["naive_lost"] = line["naive_lost"] + row["naive_lost"]
    return lines


def draw(rows: list[dict[str, Any]], base: Path) -> None:
    lines = worst_of_paths(rows)
    bottom = TOP + LINE * len(lines) + 8
    canvas = Canvas(bottom + 40)
    canvas.text(16, 24, "Worst error over all hard inputs", 16)
    naive = "the textbook's formula in float32 (a cross: NaN or ∞, too)"
    legend = ((OURS, "ours"), (TEXTBOOK, naive), (BOUND, "promised"))
    x = 16
    for color, words in legend:
        if color == BOUND:
            canvas.line(x, 36, x, 50, color, 2)
        else:
            canvas.dot(x, 43, color)
        canvas.text(x + 10, 47, words, 12)
        x += 30 + 8 * len(words)
    for decade in range(round(math.log10(LOW)), round(math.log10(HIGH)) + 1):
        at = place(10.0**decade)
        canvas.line(at, TOP, at, bottom, PALE)
        canvas.text(at, bottom + 16, f"1e{decade}", 11, anchor="middle")
    canvas.text(0.5 * (LEFT + WIDTH), bottom + 34, "error, as a share of the unit in the table", 12, anchor="middle")
    for i, ((quantity, part, half), row) in enumerate(lines.items()):
        y = TOP + LINE * (i + 0.5) + 4
        canvas.text(LEFT - 12, y + 4, f"{quantity}{', bfloat16' if half else ''}, {part}", 11, anchor="end")
        canvas.line(place(row["bound"]), y - 6, place(row["bound"]), y + 6, BOUND, 2)
        if "naive" in row:
            canvas.dot(place(row["naive"]), y, TEXTBOOK)
        if row["naive_lost"]:
            canvas.cross(WIDTH - RIGHT + 14, y, TEXTBOOK)
        canvas.dot(place(row["ours"]), y, OURS, 3.5)
    canvas.write(base)
