"""Inside Blender: writes EXRs' pixels as raw float32 RGBA, rows from the top. Arguments: EXR OUT, EXR OUT …"""

import array
import sys

import bpy

names = sys.argv[sys.argv.index("--") + 1 :]
for source, target in zip(names[::2], names[1::2], strict=True):
    image = bpy.data.images.load(source)
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    values = array.array("f", [0.0]) * (width * height * 4)
    image.pixels.foreach_get(values)
    with open(target, "wb") as file:
        for y in reversed(range(height)):
            file.write(values[4 * width * y : 4 * width * (y + 1)].tobytes())
