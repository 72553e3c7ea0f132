"""The photons of one pass, as the light pass leaves them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pmviewer.photons.deposition.deposited import Deposited
from pmviewer.photons.emission.guided import Guided

Float = NDArray[np.float32]


@dataclass(frozen=True)
class PhotonMaps:
    """Photons of one pass: `caustic` and `global_` (n, 6) float32 as in `pmviewer.maps.record`, with their units of
    power in watts, `normals` (n,) uint32 of the surfaces that the global photons lie on, on the side that they came
    from, as codes of `encode_direction` (empty unless asked for), `emitted` trajectories, `rays` cast, `dropped`
    non-finite photons, the energy `ledgers` (2, N_LEDGER), see `pmviewer.photons.light_pass.trace`, and what they
    say of the light: `energy` (5,), watts of luminance that the lights emit and that are absorbed, escape, are still on
    their way after the last scattering allowed, and were dropped.

    With a deposition rule, `caustic_normals` are those of the caustic photons, `sample` (n, 6) are photons of the first
    trajectories as they arrived, a map by themselves in units of `sample_unit`, for whoever counts photons, and
    `deposited` says what became of each map's."""

    caustic: Float
    global_: Float
    caustic_unit: float
    global_unit: float
    emitted: int
    rays: int
    dropped: int
    ledgers: NDArray[np.float64]
    energy: NDArray[np.float64]
    normals: NDArray[np.uint32]
    caustic_normals: NDArray[np.uint32] = field(default_factory=lambda: np.empty(0, np.uint32))
    sample: Float = field(default_factory=lambda: np.empty((0, 6), np.float32))
    sample_unit: float = 0.0
    deposited: Mapping[str, Deposited] = field(default_factory=dict)
    guided: Guided | None = None
    """The emission, where it is guided; the ledgers then leave out its test photons."""
    volume: Float = field(default_factory=lambda: np.empty((0, 6), np.float32))
    """Photons (n, 6) that collided in media after they were scattered, with the power that they were scattered with, in
    units of `volume_unit`."""
    volume_unit: float = 0.0
    pieces: int = 0
    """Photons that others were split into on their way, beside themselves (`pmviewer.photons.emission.window`)."""
    cuts: Mapping[str, NDArray[np.int64]] = field(default_factory=dict)
    """Of a pass in M parts: (M + 1,) rows between which the photons of each part are, in the caustic and the global
    map."""

    def parts(self, name: str) -> list[Float]:
        """The photons (n, 6) of each part in the map "caustic" or "global"."""
        stored, cuts = self.caustic if name == "caustic" else self.global_, self.cuts[name]
        return [stored[first:end] for first, end in pairwise(cuts)]

    @property
    def ledger(self) -> NDArray[np.float64]:
        """The ledger of all trajectories (N_LEDGER,)."""
        return np.asarray(self.ledgers.sum(axis=0))

    @property
    def bytes(self) -> int:
        """Of all photons and normals, for the stage store; grids and trees count for themselves."""
        arrays = self.caustic, self.global_, self.normals, self.caustic_normals, self.sample, self.volume
        return sum(array.nbytes for array in arrays)
