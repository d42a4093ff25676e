"""Fieldgraft: text-driven, localised editing of neural radiance fields.

Arrays are NumPy float32; pictures are H×W×C (or N×H×W×C) in [0, 1]. Bad input raises InputError (a ValueError) with one
line that says what, where, and what would be right.
"""

from fieldgraft._core import Failure, Guidance, InputError, Tokenizer, blend

__all__ = ["Failure", "Guidance", "InputError", "Tokenizer", "blend"]
