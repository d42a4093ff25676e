"""The golden safetensors files against the format's own Python package.

`python tests/base/test_safetensors_golden.py` writes reference.safetensors again.
"""

from pathlib import Path

import safetensors
import safetensors.torch
import torch

GOLDEN = Path(__file__).resolve().parents[1] / "golden" / "safetensors"


def reference_tensors() -> dict[str, torch.Tensor]:
    return {
        "half": torch.arange(4).reshape(2, 2).half() / 4,
        "bfloat": (torch.arange(3) - 1).bfloat16(),
        "float": torch.arange(6).reshape(1, 2, 3).float() * 0.5,
        "long": torch.arange(3) - 2**40,
        "bool": torch.tensor([True, False]),
    }


def test_reference_file_is_the_packages() -> None:
    expected = safetensors.torch.save(reference_tensors(), {"made_by": "safetensors"})
    loaded = safetensors.torch.load((GOLDEN / "reference.safetensors").read_bytes())
    again = safetensors.torch.load(expected)
    assert loaded.keys() == again.keys()
    assert all(torch.equal(loaded[name], again[name]) for name in again)


def test_package_reads_our_file() -> None:
    with safetensors.safe_open(GOLDEN / "ours.safetensors", framework="pt") as file:
        assert file.metadata() == {"config": '{"x": 1}'}
        assert torch.equal(file.get_tensor("a.float"), torch.arange(6).reshape(2, 3).float())
        assert torch.equal(file.get_tensor("b.half"), torch.arange(4).half() / 8)
        assert torch.equal(file.get_tensor("c.bfloat"), torch.arange(2).bfloat16())
        assert torch.equal(file.get_tensor("d.long"), torch.arange(2))


if __name__ == "__main__":
    GOLDEN.mkdir(parents=True, exist_ok=True)
    content = safetensors.torch.save(reference_tensors(), {"made_by": "safetensors"})
    (GOLDEN / "reference.safetensors").write_bytes(content)
