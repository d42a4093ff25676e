"""Data flows one way through the house: an #include may only point at a room that the includer's row names."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# What each room may use directly; what those use comes with them.
USES = {
    "core/base": set(),
    "core/kernels": set(),
    "core/scene": {"core/base"},
    "core/field": {"core/base", "core/kernels"},
    "core/render": {"core/scene", "core/field", "core/kernels"},
    "core/guidance": {"core/base"},
    "core/train": {"core/render"},
    "core/edit": {"core/train", "core/guidance"},
    "vdb_export": {"core/field", "core/render"},
    "core/profile": {"core/edit", "vdb_export"},
    "core/app": {"core/profile"},
    "python_bindings": {"core/edit", "vdb_export"},
}
TORCH_FREE = {"core/kernels"}
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^">]+)[">]', re.MULTILINE)


def reachable(room: str) -> set[str]:
    rooms, todo = set(), [room]
    while todo:
        for used in USES[todo.pop()]:
            if used not in rooms:
                rooms.add(used)
                todo.append(used)
    return rooms


def room_of(path: str) -> str | None:
    return next((room for room in USES if path.startswith(room + "/")), None)


def wrong_edges(room: str, name: str, text: str) -> list[str]:
    """The includes of one file that point the wrong way, as readable lines."""
    wrong = []
    for bracket, target in INCLUDE.findall(text):
        if bracket == '"':
            other = room_of(target)
            if other is None:
                wrong.append(f'{name}: "{target}" is in no room; write it from the top of the tree')
            elif other != room and other not in reachable(room):
                wrong.append(f"{name}: {room} may not use {other} ({target})")
        elif room in TORCH_FREE and re.match(r"(torch|ATen|c10)/", target):
            wrong.append(f"{name}: {room} is free of libtorch ({target})")
        elif target.startswith("openvdb/") and room != "vdb_export":
            wrong.append(f"{name}: only vdb_export includes OpenVDB ({target})")
    return wrong


@pytest.mark.parametrize("room", sorted(USES))
def test_includes_point_the_right_way(room: str) -> None:
    files = [p for p in (ROOT / room).rglob("*") if p.suffix in {".h", ".cpp"}]
    wrong = [line for p in files for line in wrong_edges(room, str(p.relative_to(ROOT)), p.read_text())]
    assert not wrong, "\n".join(wrong)


def test_the_test_sees_wrong_edges() -> None:
    assert wrong_edges("core/base", "x.cpp", '#include "core/scene/scene.h"')
    assert wrong_edges("core/kernels", "x.cpp", "#include <ATen/ATen.h>")
    assert wrong_edges("core/render", "x.cpp", "#include <openvdb/openvdb.h>")
    assert wrong_edges("core/field", "x.cpp", '#include "field.h"')
    assert not wrong_edges("core/edit", "x.cpp", '#include "core/base/json.h"\n#include <vector>')
