"""CLIP's form of byte-level BPE (Radford et al. 2021), trained on our own captions.

Text is NFC-normalised, white space collapsed, lower-cased, split by CLIP's pattern and mapped to printable bytes;
merges are learnt inside words and a word's last symbol carries `</w>`. The vocabulary has CLIP's layout: 256 byte
symbols, the same with `</w>`, one entry a merge, then <|startoftext|> and <|endoftext|> (the highest id, so "the first
end token" and "the largest id" are the same place). `vocab.json` and `merges.txt` load in transformers' CLIPTokenizer.
`words.txt` lists the words the captions held: anything else deserves a warning, not a silent embedding.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path

import torch
from tokenizers import Regex, Tokenizer, decoders, models, normalizers, pre_tokenizers, trainers
from torch import Tensor

START, END = "<|startoftext|>", "<|endoftext|>"
PATTERN = r"'s|'t|'re|'ve|'m|'ll|'d|[\p{L}]+|[\p{N}]|[^\s\p{L}\p{N}]+"
SUFFIX = "</w>"
MAX_ENTRIES = 4096


def write_text(path: Path, text: str) -> None:
    """Write through a temporary name, so that no reader sees half a file."""
    part = path.with_name(path.name + ".part")
    part.write_text(text, encoding="utf-8")
    os.replace(part, path)


def byte_symbols() -> list[str]:
    """GPT-2's printable stand-ins for the 256 bytes, in CLIP's order."""
    kept = [*range(ord("!"), ord("~") + 1), *range(0xA1, 0xAD), *range(0xAE, 0x100)]
    moved = [b for b in range(256) if b not in kept]
    return [chr(b) for b in kept] + [chr(256 + i) for i in range(len(moved))]


def build(vocab: dict[str, int], merges: list[tuple[str, str]]) -> Tokenizer:
    """The tokenizers-library object with CLIP's normaliser, splitter and suffix."""
    tokenizer = Tokenizer(models.BPE(vocab, merges, end_of_word_suffix=SUFFIX, unk_token=END))
    tokenizer.normalizer = normalizers.Sequence(
        [normalizers.NFC(), normalizers.Replace(Regex(r"\s+"), " "), normalizers.Lowercase()]
    )
    split = pre_tokenizers.Split(Regex(PATTERN), "removed", invert=True)
    tokenizer.pre_tokenizer = pre_tokenizers.Sequence([split, pre_tokenizers.ByteLevel(add_prefix_space=False)])
    tokenizer.decoder = decoders.ByteLevel()
    tokenizer.add_special_tokens([START, END])
    return tokenizer


def learn_merges(captions: Iterable[str], count: int) -> list[tuple[str, str]]:
    """At most `count` merges, most frequent first."""
    draft = build({END: 0}, [])
    trainer = trainers.BpeTrainer(
        vocab_size=count + 512,
        min_frequency=2,
        special_tokens=[END],
        show_progress=False,
        initial_alphabet=byte_symbols(),
        end_of_word_suffix=SUFFIX,
    )
    draft.train_from_iterator(captions, trainer)
    learnt = json.loads(draft.to_str())["model"]["merges"]
    return [(a, b) for a, b in learnt][:count]


class CaptionTokenizer:
    """Strings to padded token ids; remembers what it has seen, as captions repeat."""

    def __init__(self, vocab: dict[str, int], merges: list[tuple[str, str]], words: set[str], length: int) -> None:
        self.vocab, self.merges, self.words, self.length = vocab, merges, words, length
        self.start, self.end = vocab[START], vocab[END]
        self._bpe = build(vocab, merges)
        self._cache: dict[str, list[int]] = {}

    @classmethod
    def train(cls, captions: list[str], length: int, entries: int = MAX_ENTRIES) -> CaptionTokenizer:
        symbols = byte_symbols()
        merges = learn_merges(captions, entries - 2 * len(symbols) - 2)
        ordered = symbols + [s + SUFFIX for s in symbols] + [a + b for a, b in merges]
        ordered = list(dict.fromkeys(ordered)) + [START, END]
        split = build({END: 0}, [])
        words: set[str] = set()
        for caption in set(captions):
            normal = split.normalizer.normalize_str(caption)
            words.update(normal[a:b] for _, (a, b) in split.pre_tokenizer.pre_tokenize_str(normal))
        return cls({s: i for i, s in enumerate(ordered)}, merges, words, length)

    @classmethod
    def load(cls, folder: Path, length: int) -> CaptionTokenizer:
        vocab = json.loads((folder / "vocab.json").read_text(encoding="utf-8"))
        lines = (folder / "merges.txt").read_text(encoding="utf-8").splitlines()[1:]
        merges = [(a, b) for a, b in (line.split(" ") for line in lines if line)]
        words = folder / "words.txt"
        known = set(words.read_text(encoding="utf-8").split()) if words.exists() else set()
        return cls(vocab, merges, known, length)

    def save(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        write_text(folder / "vocab.json", json.dumps(self.vocab, ensure_ascii=False))
        write_text(folder / "merges.txt", "#version: 0.2\n" + "".join(f"{a} {b}\n" for a, b in self.merges))
        write_text(folder / "words.txt", "".join(f"{w}\n" for w in sorted(self.words)))

    def ids(self, text: str) -> list[int]:
        """One caption: start, pieces cut to fit, end."""
        if text not in self._cache:
            if len(self._cache) > 200_000:
                self._cache.clear()
            pieces = self._bpe.encode(text, add_special_tokens=False).ids[: self.length - 2]
            self._cache[text] = [self.start, *pieces, self.end]
        return self._cache[text]

    def __call__(self, texts: list[str]) -> Tensor:
        """N x L ids, L the longest of these texts, padded with the end token."""
        rows = [self.ids(t) for t in texts]
        longest = max(map(len, rows))
        return torch.tensor([r + [self.end] * (longest - len(r)) for r in rows])

    def decode(self, ids: list[int]) -> str:
        """The normalised text of one row of ids."""
        return self._bpe.decode(ids, skip_special_tokens=True).replace(SUFFIX, " ").strip()
