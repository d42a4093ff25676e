"""The C++ tokenizer against transformers' CLIPTokenizer: the same ids on 1,000 odd strings."""

import gzip
import json
import random
from pathlib import Path

import pytest

pytest.importorskip("transformers")
fieldgraft = pytest.importorskip("fieldgraft", reason="the Python package is not built: ./dev build")
from guidance_references import reference_tokenizer, small_vocabulary, write_vocabulary  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
BPE = ROOT.parent / "shared" / "data" / "clip" / "bpe_simple_vocab_16e6.txt.gz"


def odd_strings(count: int) -> list[str]:
    """Fixed nasty strings ([text, count]: repeated), mixtures of their pieces, random code points."""
    items = json.loads((Path(__file__).parent / "odd_strings.json").read_text("utf-8"))
    fixed = [item if isinstance(item, str) else item[0] * item[1] for item in items]
    draw = random.Random(20230717)
    parts = [text for text in fixed if 0 < len(text) < 40]
    parts += list("abcXYZ019 '\".,;:!?-_/\\()[]{}<>|@#%^&*+=~\t\n")
    parts += ["'s", "'LL", " the ", "Photo", "bulldozer", "\u0308", "\u0327"]
    while len(fixed) < count // 2:
        fixed.append("".join(draw.choice(parts) for _ in range(draw.randint(1, 12))))
    ranges = [(0x20, 0x7F), (0xA0, 0x250), (0x300, 0x370), (0x370, 0x530), (0x600, 0x700), (0x900, 0xA00)]
    ranges += [(0x1E00, 0x2000), (0x2000, 0x2C00), (0x3000, 0x3100), (0x4E00, 0x5000), (0xAC00, 0xAD00)]
    ranges += [(0xF900, 0xFB00), (0x1D400, 0x1D600), (0x1F300, 0x1F650)]
    while len(fixed) < count:
        picked = (draw.choice(ranges) for _ in range(draw.randint(1, 30)))
        fixed.append("".join(chr(draw.randrange(*span)) for span in picked))
    return fixed


@pytest.fixture(scope="module")
def clip_vocabulary(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if not BPE.exists():
        pytest.skip(f"no CLIP vocabulary at {BPE}")
    folder = tmp_path_factory.mktemp("vocabulary")
    lines = gzip.decompress(BPE.read_bytes()).decode("utf-8").split("\n")
    vocabulary = write_vocabulary(folder, lines[1 : 49152 - 256 - 2 + 1])
    assert len(vocabulary) == 49408
    return folder


def test_tokenizer_matches_on_odd_strings(clip_vocabulary: Path) -> None:
    ours = fieldgraft.Tokenizer.load(clip_vocabulary)
    reference = reference_tokenizer(clip_vocabulary)
    texts = odd_strings(1000)
    assert len(texts) == 1000
    wrong = []
    for text in texts:
        expected = reference(text, truncation=True, max_length=77)["input_ids"]
        got = ours.encode(text, 77)
        if got != expected:
            wrong.append((text[:60], got[:20], expected[:20]))
    assert not wrong, f"{len(wrong)} of {len(texts)} differ: {wrong[:5]}"


def test_tokenizer_knows_clips_own_ids(clip_vocabulary: Path) -> None:
    """Ids that OpenAI's model is known by."""
    ids = fieldgraft.Tokenizer.load(clip_vocabulary).encode("a photo of a cat")
    assert ids == [49406, 320, 1125, 539, 320, 2368, 49407]


def test_tokenizer_matches_on_a_small_vocabulary(tmp_path: Path) -> None:
    small_vocabulary(tmp_path)
    ours, reference = fieldgraft.Tokenizer.load(tmp_path), reference_tokenizer(tmp_path)
    for text in odd_strings(300):
        assert ours.encode(text, 12) == reference(text, truncation=True, max_length=12)["input_ids"], text
