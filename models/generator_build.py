"""Builds and imports the picture generator (models/generator) on its own.

`load()` takes the module that the project's build left in build/release/models if it is newer than the sources;
otherwise it builds it with CMake into build/generator. `python models/generator_build.py` only builds;
`python models/generator_build.py --heldout-hash` prints the hash that pins the held-out test (models/generator/
heldout.sha256): SHA-256 over the bytes of heldout_settings.json and of the first 64 held-out pairs' pictures,
captions, queries and masks. `python models/generator_build.py --speed` prints pictures a second on every core.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).resolve().parent.parent
SOURCES = ROOT / "models" / "generator"
HELDOUT_SEED = 20261


def _newest_source() -> float:
    return max(p.stat().st_mtime for p in SOURCES.iterdir() if p.suffix in {".cpp", ".h", ".txt"})


def _built(folder: Path) -> Path | None:
    modules = sorted(folder.glob("scene_generator*.so"))
    return modules[0] if modules and modules[0].stat().st_mtime >= _newest_source() else None


def build(folder: Path = ROOT / "build" / "generator") -> Path:
    """Builds the module with this interpreter and returns its path."""
    tool = ["-G", "Ninja"] if _has("ninja") else []
    launcher = ["-DCMAKE_CXX_COMPILER_LAUNCHER=ccache"] if _has("ccache") else []
    configure = [
        "cmake",
        "-S",
        str(SOURCES),
        "-B",
        str(folder),
        f"-DFIELDGRAFT_PYTHON={sys.executable}",
        *tool,
        *launcher,
    ]
    for command in (configure, ["cmake", "--build", str(folder), "-j", str(os.cpu_count() or 1)]):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise RuntimeError(f"{' '.join(command)} failed:\n{done.stdout}{done.stderr}")
    module = next(iter(sorted((folder / "models").glob("scene_generator*.so"))), None)
    if module is None:
        raise RuntimeError(f"no scene_generator module in {folder / 'models'} after the build")
    os.utime(module)
    return module


def _has(program: str) -> bool:
    return any((Path(p) / program).exists() for p in os.environ.get("PATH", "").split(os.pathsep))


def load() -> ModuleType:
    """The module scene_generator, built if need be."""
    path = _built(ROOT / "build" / "release" / "models") or _built(ROOT / "build" / "generator" / "models") or build()
    spec = importlib.util.spec_from_file_location("scene_generator", path)
    if spec is None or spec.loader is None:
        raise RuntimeError(f"{path} cannot be imported")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def heldout_hash() -> str:
    """Changes when the held-out test does: by its settings, the generator, or the combinations that are held out."""
    settings = (SOURCES / "heldout_settings.json").read_bytes()
    batch = load().Generator(HELDOUT_SEED, "heldout", 64, settings.decode()).batch(64)
    digest = hashlib.sha256(settings)
    digest.update(batch["images"].tobytes())
    for pair in batch["captions"]:
        digest.update("\n".join(pair).encode())
    digest.update(batch["masks"].tobytes())
    digest.update(repr(batch["queries"]).encode())
    return digest.hexdigest()


def speed(threads: int, pairs: int = 512, rounds: int = 5) -> float:
    """Pictures a second of the training split, captions, queries and masks with them; the median of some rounds."""
    generator = load().Generator(1, "train", 64)
    generator.batch(pairs, threads=threads)
    seconds = []
    for _ in range(rounds):
        start = time.perf_counter()
        generator.batch(pairs, threads=threads)
        seconds.append(time.perf_counter() - start)
    return 2 * pairs / sorted(seconds)[rounds // 2]


def main() -> None:
    if "--heldout-hash" in sys.argv[1:]:
        print(heldout_hash())
    elif "--speed" in sys.argv[1:]:
        for threads in sorted({1, os.cpu_count() or 1}):
            print(f"{threads} threads: {speed(threads):.0f} pictures a second")
    else:
        print(build())


if __name__ == "__main__":
    main()
