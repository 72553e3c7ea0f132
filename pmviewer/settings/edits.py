"""The vocabulary of edits: what of a scene's lights, materials and objects can be changed, and within which bounds.

An edit is "light.lamp.power = 2": a kind, a name (or number from 1) within the scene, a property, and its numbers. What
a name stands for is decided where the scene is known (`pmviewer.scene.editing`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

Edits = Mapping[str, tuple[float, ...]]
"""Numbers by the full name of an edit, "light.lamp.power"."""


@dataclass(frozen=True)
class Property:
    """`count` numbers from `low` to `high`; `neutral` changes nothing, None where the scene's own value is not known
    beforehand."""

    text: str
    count: int
    low: float
    high: float
    neutral: tuple[float, ...] | None = None


_MOVE = Property("scene units along x, y and z", 3, -1e15, 1e15, (0.0, 0.0, 0.0))
_TURN = Property("degrees about the x, then the y, then the z axis, around its middle", 3, -3600.0, 3600.0, (0.0,) * 3)

PROPERTIES: dict[str, dict[str, Property]] = {
    "light": {
        "power": Property("times what the file says", 1, 0.0, 1e12, (1.0,)),
        "colour": Property("linear RGB; it changes the hue, not the power", 3, 0.0, 1e6),
        "move": _MOVE,
        "turn": _TURN,
    },
    "material": {
        "colour": Property("linear RGB of what it reflects; a texture is tinted to have it in the mean", 3, 0.0, 1.0),
        "roughness": Property("roughness of its gloss, alpha", 1, 0.0, 1.0),
        "index": Property("index of refraction, inside over outside", 1, 0.2, 5.0),
        "dispersion": Property("20 over Abbe's number, 0 for an index that is the same for all light", 1, 0.0, 20.0),
    },
    "object": {
        "move": _MOVE,
        "turn": _TURN,
        "size": Property("times its size, around its middle", 1, 1e-6, 1e6, (1.0,)),
    },
}
"""By kind and name."""


def parts(name: str) -> tuple[str, str, str]:
    """Kind, what is meant and property of "light.lamp.power". What is meant may have dots of its own. Raises ValueError
    with a sentence."""
    kind, dot, rest = name.partition(".")
    what, last, prop = rest.rpartition(".")
    if kind not in PROPERTIES or not dot or not last or not what:
        kinds = ", ".join(PROPERTIES)
        raise ValueError(f"'{name}' is no edit: write KIND.NAME.PROPERTY, where KIND is one of {kinds}.")
    if prop not in PROPERTIES[kind]:
        known = ", ".join(PROPERTIES[kind])
        raise ValueError(f"'{name}': there is no property '{prop}' of a {kind}. Known are {known}.")
    return kind, what, prop


def property_of(name: str) -> Property:
    """What "light.lamp.power" changes. Raises ValueError with a sentence."""
    kind, _, prop = parts(name)
    return PROPERTIES[kind][prop]


def checked(edits: Any) -> dict[str, tuple[float, ...]]:
    """Edits as they are stored: by name, each a tuple of numbers. Raises ValueError with a sentence."""
    if not isinstance(edits, Mapping):
        raise ValueError('Edits are a table of names and numbers, as in "light.lamp.power" = 2.')
    return {name: _numbers(name, edits[name]) for name in sorted(edits)}


def parse(texts: Iterable[str]) -> dict[str, Any]:
    """Edits from texts like "light.lamp.power=2" and "material.wall.colour=0.8, 0.2, 0.2". Raises ValueError."""
    edits: dict[str, Any] = {}
    for text in texts:
        name, separator, value = text.partition("=")
        if not separator:
            raise ValueError(f"'{text}' is no edit: write NAME=VALUE, for example light.1.power=2.")
        edits[name.strip()] = tuple(part for part in re.split(r"[,\s]+", value.strip()) if part)
    return checked(edits)


def as_text(edits: Edits) -> str:
    """The inverse of `parse`, with semicolons between edits."""
    return "; ".join(f"{name}={', '.join(f'{v:.6g}' for v in values)}" for name, values in edits.items())


def _numbers(name: str, value: Any) -> tuple[float, ...]:
    what = property_of(name)
    items = value if isinstance(value, list | tuple) else (value,)
    try:
        numbers = tuple(float(item) for item in items if not isinstance(item, bool))
    except (TypeError, ValueError):
        numbers = ()
    if len(numbers) != len(items) or len(numbers) != what.count:
        expected = "a number" if what.count == 1 else f"{what.count} numbers"
        raise ValueError(f"{name} = {_shown(value)} is not allowed: expected {expected} ({what.text}).")
    if not all(what.low <= number <= what.high for number in numbers):
        raise ValueError(
            f"{name} = {_shown(value)} is not allowed: expected numbers from {what.low:g} to {what.high:g}."
        )
    return numbers


def _shown(value: Any) -> str:
    return ", ".join(str(item) for item in value) if isinstance(value, list | tuple) else repr(value)
