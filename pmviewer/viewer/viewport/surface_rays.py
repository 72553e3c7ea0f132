"""Rays against the triangles that the window draws: what lies under the mouse, ahead of the camera, in its way.

The engine's own tree isn't used: its kernels may have to be compiled, and the window doesn't wait for that. A few rays
a frame are cheap enough without: triangles in the order of a Z curve are boxed by 64s, and only those are
tested whose box a ray meets.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
CLUSTER = 64
_BITS = 10
"""Of a coordinate in the order of triangles."""


def _spread(values: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """The bits of 10-bit numbers with two zeros between each two."""
    for shift, mask in ((16, 0x30000FF), (8, 0x300F00F), (4, 0x30C30C3), (2, 0x9249249)):
        values = (values | (values << np.uint64(shift))) & np.uint64(mask)
    return values


class SurfaceRays:
    """Of a `DrawGeometry`. Distances in scene units."""

    def __init__(self, geometry: Any) -> None:
        corners = np.asarray(geometry.vertices, np.float32).reshape(-1, 3, 3)
        self._order = np.zeros(0, np.int64)
        if len(corners):
            middle = corners.mean(axis=1)
            low = middle.min(axis=0)
            span = max(float((middle.max(axis=0) - low).max()), 1e-30)
            cell = np.minimum((middle - low) * ((1 << _BITS) / span), (1 << _BITS) - 1).astype(np.uint64)
            code = _spread(cell[:, 0]) | (_spread(cell[:, 1]) << np.uint64(1)) | (_spread(cell[:, 2]) << np.uint64(2))
            self._order = np.argsort(code, kind="stable")
            corners = corners[self._order]
        starts = np.arange(0, len(corners), CLUSTER)
        low, high = corners.min(axis=1), corners.max(axis=1)
        self._low = np.minimum.reduceat(low, starts).astype(float) if len(corners) else np.zeros((0, 3))
        self._high = np.maximum.reduceat(high, starts).astype(float) if len(corners) else np.zeros((0, 3))
        self._corners = corners

    def nearest(self, origin: Vector, direction: Vector, start: float = 0.0) -> tuple[float, Vector] | None:
        """Distance and unit normal, towards the origin, of the first surface that the ray meets from the distance
        `start` on; None where it meets none. `direction` (3,) is a unit vector."""
        hit = self.nearest_triangle(origin, direction, start)
        return hit[:2] if hit is not None else None

    def nearest_triangle(
        self, origin: Vector, direction: Vector, start: float = 0.0
    ) -> tuple[float, Vector, int] | None:
        """As `nearest`, and the number of the triangle in the `DrawGeometry`."""
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1.0 / direction
            sides = np.stack([(self._low - origin) * inverse, (self._high - origin) * inverse])
        sides = np.where(np.isnan(sides), -np.inf, sides)  # on a side that it runs along: met
        enter, leave = sides.min(axis=0), np.where(sides.max(axis=0) == -np.inf, np.inf, sides.max(axis=0))
        margin = 1e-6 * np.abs(leave.min(axis=1))
        met = np.flatnonzero((enter.max(axis=1) <= leave.min(axis=1) + margin) & (leave.min(axis=1) >= start))
        if not len(met):
            return None
        numbers = (met[:, None] * CLUSTER + np.arange(CLUSTER)).ravel()
        numbers = numbers[numbers < len(self._corners)]
        hit = _first(self._corners[numbers].astype(float), origin, direction, start)
        return None if hit is None else (*hit[:2], int(self._order[numbers[hit[2]]]))


def _first(corners: Vector, origin: Vector, direction: Vector, start: float) -> tuple[float, Vector, int] | None:
    """The first of the triangles (n, 3, 3) that the ray meets (Möller and Trumbore 1997), and which it is."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(direction, second)
    determinant = np.einsum("ij,ij->i", first, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / determinant
        to_origin = origin - corners[:, 0]
        u = np.einsum("ij,ij->i", to_origin, p) * inverse
        q = np.cross(to_origin, first)
        v = (q @ direction) * inverse
        t = np.einsum("ij,ij->i", second, q) * inverse
        inside = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (t > start) & np.isfinite(t)
    if not inside.any():
        return None
    number = int(np.argmin(np.where(inside, t, np.inf)))
    normal = np.cross(first[number], second[number])
    normal /= max(float(np.linalg.norm(normal)), 1e-300)
    return float(t[number]), normal if normal @ direction < 0 else -normal, number
