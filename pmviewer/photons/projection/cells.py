"""Which cells of directions, or of places on a disc, photons must leave a light in to meet certain surfaces (T7).

The surfaces are covered by spheres. Conservative means: a ray that leaves the light and meets one of the spheres
belongs to a cell that is on.

- Directions. Let the light lie within the ball (a, r) and a sphere be (c, s), D = |c − a|. A ray from a point of the
  light that meets the sphere passes, moved by at most r so that it starts in a, within r + s of c. So its direction is
  at most α = asin((r + s)/D) off c − a, or anything when D ≤ r + s. A cell of polar angles θ₀ … θ₁ and azimuths of
  width Δφ around its middle m lies within ρ = (θ₁ − θ₀)/2 + max(sin θ)·Δφ/2 of m: one way along the meridian and one
  along the parallel. It is on when the angle between m and c − a is at most α + ρ.
- Places on a disc: the same with distances in the plane.

`SLACK` covers rounding and the gap by which photons start off a surface.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.photons.projection.projected import COLUMNS, ROWS

Float = NDArray[np.float64]
SLACK = 1e-4
"""Radians; also of the scene's size."""


def _azimuths() -> tuple[Float, Float]:
    phi = (np.arange(COLUMNS) + 0.5) * (2 * math.pi / COLUMNS)
    return np.cos(phi), np.sin(phi)


def cells_of_directions(spheres: Float, origin: Float, reach: float, axes: Float, edges: Float) -> NDArray[np.bool_]:
    """Cells (ROWS, COLUMNS) of directions that can lead from the ball (origin, reach) to a sphere."""
    offset = (spheres[:, :3] - origin) @ axes.T
    distance = np.linalg.norm(offset, axis=1)
    wide = spheres[:, 3] + reach
    if np.any(distance <= wide):
        return np.ones((ROWS, COLUMNS), np.bool_)
    alpha = np.arcsin(wide / distance)
    middle, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
    holds_equator = (edges[:-1] <= math.pi / 2) & (edges[1:] >= math.pi / 2)
    widest = np.where(holds_equator, 1.0, np.maximum(np.sin(edges[:-1]), np.sin(edges[1:])))
    rho = half + widest * (math.pi / COLUMNS) + SLACK
    x, y = _azimuths()
    on = np.zeros((ROWS, COLUMNS), np.bool_)
    for row in range(ROWS):
        r = math.sin(middle[row])
        m = np.stack([r * x, r * y, np.full(COLUMNS, math.cos(middle[row]))], axis=1)
        least = np.cos(np.minimum(alpha + rho[row], math.pi))
        on[row] = np.any(m @ (offset / distance[:, None]).T >= least, axis=1)
    return on


def cells_of_places(spheres: Float, center: Float, axes: Float, edges: Float, slack: float) -> NDArray[np.bool_]:
    """Cells of the disc across the last of `axes` from which parallel rays can meet a sphere."""
    across = (spheres[:, :3] - center) @ axes[:2].T
    middle = (edges[1:] + edges[:-1]) / 2
    rho = np.diff(edges) / 2 + edges[1:] * (math.pi / COLUMNS) + slack
    x, y = _azimuths()
    on = np.zeros((ROWS, COLUMNS), np.bool_)
    for row in range(ROWS):
        m = middle[row] * np.stack([x, y], axis=1)
        gap = np.linalg.norm(m[:, None] - across[None], axis=2)
        on[row] = np.any(gap <= spheres[:, 3] + rho[row], axis=1)
    return on
