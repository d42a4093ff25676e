"""Run inside Blender (`blender --python blender_addon/develop.py`): enables the add-on of this checkout."""

import sys
from pathlib import Path

import addon_utils

folder = Path(__file__).resolve().parent
sys.path.insert(0, str(folder.parent))
if addon_utils.enable(folder.name, default_set=False, persistent=False) is None:
    raise SystemExit(f"the add-on in {folder} could not be enabled")
