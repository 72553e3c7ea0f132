"""Strata of emission (I6): each light's photons divided by where they start and in which direction, and photons that
start in strata chosen by a table.

The strata are cells of the unit hypercube of the four numbers that `emit_from` makes a photon of: two for the place,
two for the direction. So the strata of a light have equal shares of its power whatever its kind; they are cones of
directions, patches of its surface, or both:

==================================  =====================================
point, spot, projector              directions
directional                         places on the disc that photons start on
surfaces, environments              directions; with many strata also places
==================================  =====================================
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels import scene as K
from pmviewer.photons.emission.stratified import STRATA_DTYPE
from pmviewer.photons.emission.window import Window, fill_window
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.scene.description import LUMINANCE

MOST_DIVISIONS = 16
"""Divisions of one number."""
WITH_PLACES = 256
"""Strata a light from which those of a surface divide places, too."""


@dataclass(frozen=True, eq=False)
class Strata:
    """The strata of a scene's lights, light by light: `light` (n,) and `cells` (n_lights, 4) as for kernels, `power`
    (n,) float64 shares of the emitted luminance, which sum to 1."""

    light: NDArray[np.int32]
    first: NDArray[np.int32]
    cells: NDArray[np.int32]
    power: NDArray[np.float64]

    @property
    def n(self) -> int:
        """Strata of all lights."""
        return len(self.light)


@dataclass(frozen=True, eq=False)
class StrataTable:
    """What kernels take: `records` (2,) of STRATA_DTYPE, alike, in the place of those of projection maps. Valid while
    this lives."""

    records: NDArray[np.void]
    arrays: tuple[NDArray, ...]
    window: Window | None = None


def strata_of(scene: FlatScene, most: int) -> Strata | None:
    """At most `most` strata of about equal power; None where there are more lights than that, or none that emit."""
    kinds = scene.lights[: len(scene.light_names), K.L_KIND].astype(int)
    n_lights, power = len(kinds), scene.light_power @ LUMINANCE
    if most < n_lights or not power.sum() > 0:
        return None
    numbers = 1 + (most - n_lights) * power / power.sum()
    cells = np.array([_divisions(int(kind), int(n)) for kind, n in zip(kinds, numbers, strict=True)], np.int32)
    counts = cells.prod(axis=1)
    light = np.repeat(np.arange(n_lights, dtype=np.int32), counts)
    first = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int32)
    return Strata(light, first, cells, (power / power.sum() / counts)[light])


def _divisions(kind: int, n: int) -> tuple[int, int, int, int]:
    root = min(int(n**0.5), MOST_DIVISIONS)
    if kind in (K.POINT, K.SPOT, K.PROJECTOR):
        return 1, 1, root, root
    if kind == K.DIRECTIONAL:
        return root, root, 1, 1
    if n < WITH_PLACES:
        return 1, 1, root, root
    if kind in (K.ENVIRONMENT, K.IMAGE):
        each = min(int(n**0.25), MOST_DIVISIONS)
        return each, each, each, each
    root = min(int((n / 4) ** 0.5), MOST_DIVISIONS)
    return 2, 2, root, root


def table_of(
    strata: Strata,
    share: NDArray[np.float64] | None,
    weight: NDArray[np.float64] | None,
    window: Window | None = None,
    pieces_of: float = 0.0,
) -> StrataTable:
    """The table by which photons start in stratum s with probability ∝ share[s] and power weight[s], in units of the
    map's; (n,) both. With None for them that of test photons: each stratum in turn, of power 1."""
    even = share is None
    cdf = np.cumsum(np.ones(strata.n) if share is None else share)
    weights = np.ones(strata.n) if weight is None else weight
    arrays = (
        cdf / cdf[-1],
        np.ascontiguousarray(strata.light),
        np.ascontiguousarray(strata.first),
        np.ascontiguousarray(strata.cells),
        weights.astype(np.float32),
    )
    records = np.zeros(2, STRATA_DTYPE)
    records["strata"], records["tests"] = strata.n, even
    for name, array in zip(("cdf", "light", "first", "cells", "weight"), arrays, strict=True):
        records[name] = array.ctypes.data
    fill_window(records, window, pieces_of)
    return StrataTable(records, arrays, window)
