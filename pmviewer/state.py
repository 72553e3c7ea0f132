"""What an object has found so far, as numbers and arrays: enough for another one, in another process, to go on from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray


@dataclass(frozen=True)
class State:
    """`numbers` are what JSON can hold; `arrays` are the owner's own, not copies: they hold until it goes on."""

    numbers: Mapping[str, Any] = field(default_factory=dict)
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)

    @staticmethod
    def of_parts(numbers: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], /, **parts: State | None) -> State:
        """Of an object's own numbers and arrays, and by name the states of its parts, None for those that it lacks."""
        found = {name: part for name, part in parts.items() if part is not None}
        of_parts = {f"{name}.{key}": array for name, part in found.items() for key, array in part.arrays.items()}
        return State({**numbers, **{name: part.numbers for name, part in found.items()}}, {**arrays, **of_parts})

    def part(self, name: str) -> State:
        """The part of that name. Raises ValueError where there is none."""
        numbers = self.numbers.get(name)
        if not isinstance(numbers, Mapping):
            raise ValueError(f"{name} is missing")
        prefix = f"{name}."
        return State(numbers, {k.removeprefix(prefix): a for k, a in self.arrays.items() if k.startswith(prefix)})

    def number(self, name: str) -> Any:
        """Raises ValueError where there is none."""
        if name not in self.numbers:
            raise ValueError(f"{name} is missing")
        return self.numbers[name]

    def array(self, name: str, shape: tuple[int | None, ...], dtype: DTypeLike) -> NDArray[Any]:
        """The array of that name; None in `shape` stands for any length. Raises ValueError for another one."""
        if name not in self.arrays:
            raise ValueError(f"the array {name} is missing")
        found = self.arrays[name]
        fits = len(found.shape) == len(shape) and all(b is None or a == b for a, b in zip(found.shape, shape))
        if not fits or found.dtype != np.dtype(dtype):
            raise ValueError(f"the array {name} is {found.shape} {found.dtype}, not {shape} {np.dtype(dtype)}")
        return found
