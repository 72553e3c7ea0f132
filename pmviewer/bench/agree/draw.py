"""Random numbers as scene files like them: short decimals, plain Python types."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")


class Draw:
    """The random numbers of scene i of seed S, a pure function of both."""

    def __init__(self, seed: int, index: int) -> None:
        self._rng = np.random.default_rng([seed, index])

    def number(self, low: float, high: float) -> float:
        """Uniform, with four digits after the point."""
        return round(float(self._rng.uniform(low, high)), 4)

    def log(self, low: float, high: float) -> float:
        """Uniform in the logarithm, with three significant digits."""
        return float(f"{np.exp(self._rng.uniform(np.log(low), np.log(high))):.3g}")

    def integer(self, low: int, high: int) -> int:
        """Uniform from `low` to `high`, both included."""
        return int(self._rng.integers(low, high + 1))

    def seed(self) -> int:
        """For whatever has a seed of its own: 0 to a million."""
        return self.integer(0, 10**6)

    def chance(self, p: float) -> bool:
        """True with the probability p."""
        return bool(self._rng.uniform() < p)

    def pick(self, values: Sequence[T]) -> T:
        """One of the values, each as likely."""
        return values[int(self._rng.integers(len(values)))]

    def some(self, values: Sequence[T], count: int) -> list[T]:
        """`count` different ones in random order."""
        return [values[int(i)] for i in self._rng.permutation(len(values))[:count]]

    def colour(self, low: float, high: float) -> list[float]:
        """Three numbers (r, g, b), each uniform from `low` to `high`."""
        return [self.number(low, high) for _ in range(3)]

    def within(self, box: float) -> list[float]:
        """A point of the cube −box … box."""
        return [self.number(-box, box) for _ in range(3)]

    def direction(self) -> list[float]:
        """A vector of length 1."""
        v = self._rng.normal(0, 1, 3)
        return [round(float(c), 8) for c in v / np.linalg.norm(v)]

    def turn(self, free: bool = False) -> list[Any]:
        """A rotation about any axis. Where `free`, some axes are not of unit length, which stretches and shears."""
        length = self.number(0.7, 1.4) if free and self.chance(0.2) else 1.0
        return ["rotate", [length * c for c in self.direction()], self.number(-180, 180)]
