"""Numbers on a lattice in space, as loaders describe them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Grid:
    """`values` (nz, ny, nx, 1 or 3) float32, finite and not negative, each in the middle of its share of the unit cube;
    `to_world` (4, 4) float64 moves that cube into the world."""

    values: NDArray[np.float32]
    to_world: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    name: str = "grid"

    @property
    def most(self) -> float:
        """The greatest number."""
        return float(self.values.max(initial=0.0))
