"""A scene of many large images out of the demo scene's few: does training stay within its memory?

Every view of `demo/scene` is enlarged to 1080 pixels, put into the middle of a picture of 1920, and written once as a
JPEG; the scene names hard links to these files, each of which the program decodes as an image of its own.
"""

from __future__ import annotations

import json
import math
import os
from pathlib import Path

from PIL import Image

DEMO = Path(__file__).resolve().parent.parent / "demo" / "scene"
WIDTH, HEIGHT = 1920, 1080


def write_scene(folder: Path, count: int) -> Path:
    """A nerfstudio scene of `count` images; returns its folder."""
    given = json.loads((DEMO / "transforms_train.json").read_text())
    (folder / "images").mkdir(parents=True)
    frames = []
    for i in range(count):
        frame = given["frames"][i % len(given["frames"])]
        name = f"images/{i:05d}.jpg"
        if i < len(given["frames"]):
            view = Image.open((DEMO / frame["file_path"]).with_suffix(".png")).convert("RGBA")
            view = view.resize((HEIGHT, HEIGHT), Image.Resampling.BICUBIC)
            picture = Image.new("RGBA", (WIDTH, HEIGHT), "white")
            picture.alpha_composite(view, ((WIDTH - HEIGHT) // 2, 0))
            picture.convert("RGB").save(folder / name, quality=92)
        else:
            os.link(folder / f"images/{i % len(given['frames']):05d}.jpg", folder / name)
        frames.append({"file_path": name, "transform_matrix": frame["transform_matrix"]})
    focal = 0.5 * HEIGHT / math.tan(0.5 * given["camera_angle_x"])
    camera = {"w": WIDTH, "h": HEIGHT, "fl_x": focal, "fl_y": focal, "cx": WIDTH / 2, "cy": HEIGHT / 2}
    (folder / "transforms.json").write_text(json.dumps(camera | {"frames": frames}))
    return folder
