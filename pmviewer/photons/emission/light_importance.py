"""How important the lights are for a picture: what guided emission found, for whoever shows it (I6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LightImportance:
    """Of each light, in the order of the light table (the light ids of photons): `names` (n,); `share` (n,) of the
    pass's trajectories that leave it, test photons included; `power` (n,) its share of the emitted luminance; `met`
    (n,) the importance that a trajectory of it meets on average, relative to that of the most important light, 0 … 1.
    `share`, `power` sum to 1."""

    names: tuple[str, ...]
    share: Float
    power: Float
    met: Float

    @property
    def factor(self) -> Float:
        """How many times as many trajectories leave a light as by its power; 1 for a light without power."""
        return np.divide(self.share, self.power, out=np.ones_like(self.share), where=self.power > 0)

    @property
    def lit(self) -> Float:
        """(n,) share of the picture's light that comes from each, together 1, or 0 where nothing is important."""
        brought = self.power * self.met
        total = brought.sum()
        return brought / total if total > 0 else brought
