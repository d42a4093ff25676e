"""fieldgraft.edit(): an edit from a text prompt."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fieldgraft import _core
from fieldgraft._core import Edit, Field, Guidance, InputError, Scene


def builtin_model(name: str = "guide") -> Path:
    """The folder of a built-in model ("guide" or "judge"): in $FIELDGRAFT_MODELS, or in the models/ folder of the
    nearest of this package's parent folders that has it. Raises InputError."""
    if models := os.environ.get("FIELDGRAFT_MODELS"):
        if (Path(models) / name / "config.json").exists():
            return Path(models) / name
        raise InputError(f"FIELDGRAFT_MODELS={models}: there is no {name}/config.json in it")
    for folder in Path(_core.__file__).absolute().parents:
        if (folder / "models" / name / "config.json").exists():
            return folder / "models" / name
    raise InputError(
        f"no models/{name}/config.json in the folders above {_core.__file__}; "
        f"set FIELDGRAFT_MODELS to the folder that holds {name}"
    )


def edit(
    field: Field,
    *,
    source: str,
    target: str,
    ops: Iterable[str] | str,
    scene: Scene | None = None,
    below: Sequence[Edit] = (),
    guidance: Guidance | str | os.PathLike[str] | None = None,
    segmenter: str | os.PathLike[str] | None = None,
    masks: Mapping[str, str | os.PathLike[str]] | None = None,
    mask_only: bool = False,
    checkpoint: str | os.PathLike[str] | None = None,
    resume: bool = False,
    preview: str | os.PathLike[str] | None = None,
    progress: Callable[[dict[str, Any]], bool | None] | None = None,
    **settings: Any,
) -> Edit:
    """Trains an edit of `field` and returns it.

    ops: any of "change", "add", "remove", as a set or as text with commas. guidance: a Guidance, a folder, or None for
    the built-in guide. below: the edits it lies over, the lowest first. masks: {view of the scene: picture that is
    white where to edit}; mask_only leaves the segmenter out. settings: minutes, iterations or quality, seed, preset,
    weights and whatever else an edit specification holds (docs/formats.md). progress as in train().
    """
    if not isinstance(guidance, Guidance):
        folder = Path(guidance) if guidance is not None else builtin_model()
        guidance = _core.load_guide(folder, segmenter)
    specification: dict[str, Any] = {
        **settings,
        "source": source,
        "target": target,
        "operations": ops if isinstance(ops, str) else ",".join(sorted(ops)),
    }
    if masks:
        specification["masks"] = [{"view": view, "file": str(file)} for view, file in masks.items()]
        specification["region_source"] = "masks" if mask_only else "both"
    elif mask_only:
        raise InputError("mask_only: no masks; give masks={view: picture}")
    return _core.train_edit(
        field,
        list(below),
        guidance,
        scene,
        specification,
        checkpoint,
        resume,
        preview,
        progress,
    )
