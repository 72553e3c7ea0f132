"""Numbers from an untrusted JSON object: what is no usable number counts as its default, with a warning."""

from __future__ import annotations

import math
from typing import Any

from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.gltf.document import Json, extension, has_extension

_LARGEST = 1e30


class Fields:
    """One object of the file; `name` says whose it is ("the material 'gold'")."""

    def __init__(self, row: Json, name: str, diagnostics: Diagnostics) -> None:
        self.row, self.name, self._diagnostics = row, name, diagnostics

    def number(self, key: str, default: float, low: float = -_LARGEST, high: float = _LARGEST) -> float:
        """The number, moved into [low, high] if it lies outside."""
        value = self.row.get(key, default)
        if value is default:
            return default
        if not _is_number(value):
            self._warn(key, f"{value!r:.40} is not a number: {default:g} replaces it.")
            return default
        if not low <= value <= high:
            kept = low if value < low else high
            self._warn(key, f"{value:g} is outside of {low:g} to {high:g}: {kept:g} replaces it.")
            return kept
        return float(value)

    def vector(self, key: str, default: tuple[float, ...], low: float = -_LARGEST, high: float = _LARGEST) -> Any:
        """As many numbers as the default has, as a tuple, each moved into [low, high]."""
        value = self.row.get(key, default)
        if value is default:
            return default
        if not isinstance(value, list) or len(value) < len(default) or not all(map(_is_number, value)):
            self._warn(key, f"{str(value)[:40]} is not {len(default)} numbers: {default} replaces it.")
            return default
        kept = tuple(min(high, max(low, float(v))) for v in value[: len(default)])
        if any(a != b for a, b in zip(kept, value)):
            self._warn(key, f"{str(value)[:60]} is outside of {low:g} to {high:g} and was cut.")
        return kept

    def table(self, key: str) -> Fields:
        """An object inside; empty if there is none."""
        found = self.row.get(key)
        return Fields(found if isinstance(found, dict) else {}, self.name, self._diagnostics)

    def texture(self, key: str) -> Json | None:
        """A reference to a texture."""
        found = self.row.get(key)
        return found if isinstance(found, dict) else None

    def extension(self, name: str) -> Fields:
        """An extension's object; empty if there is none."""
        return Fields(extension(self.row, name), self.name, self._diagnostics)

    def has(self, name: str) -> bool:
        """Is there an extension of this name?"""
        return has_extension(self.row, name)

    def _warn(self, key: str, sentence: str) -> None:
        self._diagnostics.warn(f"'{key}' of {self.name}: {sentence}", kind=f"field {key}")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(_as_float(value))


def _as_float(value: float) -> float:
    try:
        return float(value)
    except OverflowError:  # an integer of hundreds of digits
        return math.inf
