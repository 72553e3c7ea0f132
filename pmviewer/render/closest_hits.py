"""Rays from the engine, a few at a time, and what they meet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pmviewer.kernels.accel.raycast import cast_closest


class Hits(NamedTuple):
    """What rays met, as kernels take it: origins and directions (n, 3) float32, distances (n,) float32, primitives (n,)
    int32, −1 for none, and the places on these (n, 2) float32."""

    origins: NDArray[np.float32]
    directions: NDArray[np.float32]
    t: NDArray[np.float32]
    prims: NDArray[np.int32]
    uv: NDArray[np.float32]


def no_hits(n: int = 0) -> Hits:
    """Of n rays, not filled in."""
    points = np.empty((n, 3), np.float32), np.empty((n, 3), np.float32)
    return Hits(*points, np.empty(n, np.float32), np.empty(n, np.int32), np.empty((n, 2), np.float32))


def closest_hits(
    scene: np.void,
    origins: NDArray[np.floating],
    directions: NDArray[np.floating],
    far: ArrayLike = np.inf,
    near: ArrayLike = 0.0,
) -> Hits:
    """What rays from `origins` in the unit `directions` (n, 3) meet from `near` to `far`, one number each or (n,)."""
    hits = no_hits(len(origins))
    hits.origins[:], hits.directions[:] = origins, directions
    ends = (np.ascontiguousarray(np.broadcast_to(np.asarray(end, np.float32), len(origins))) for end in (near, far))
    cast_closest(scene, hits.origins, hits.directions, *ends, hits.t, hits.prims, hits.uv)
    return hits
