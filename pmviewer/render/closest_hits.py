"""Rays from the engine, a few at a time, and what they meet."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pmviewer.kernels.accel.raycast import cast_closest


def closest_hits(
    scene: np.void, origins: NDArray[np.floating], directions: NDArray[np.floating], far: ArrayLike = np.inf
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """What rays from `origins` in the unit `directions` (n, 3) meet nearer than `far`, one number or (n,): distances
    and primitives (n,), −1 for none."""
    n = len(origins)
    rays = (np.ascontiguousarray(part, np.float32) for part in (origins, directions))
    ends = np.zeros(n, np.float32), np.ascontiguousarray(np.broadcast_to(np.asarray(far, np.float32), n))
    t, primitive, uv = np.empty(n, np.float32), np.empty(n, np.int32), np.empty((n, 2), np.float32)
    cast_closest(scene, *rays, *ends, t, primitive, uv)
    return t, primitive
