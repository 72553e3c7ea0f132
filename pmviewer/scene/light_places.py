"""Where the lights of a scene are, for marking them in pictures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels import scene as K
from pmviewer.scene.arrays.flatten import FlatScene

NOWHERE = (K.DIRECTIONAL, K.ENVIRONMENT, K.IMAGE)


def light_places(scene: FlatScene) -> NDArray[np.float64]:
    """(n, 3) middles of the lights in the order of the light table; NaN for those that shine from outside."""
    rows = scene.lights.astype(np.float64)
    kinds = rows[:, K.L_KIND].astype(int)
    a, b, c = (rows[:, first : first + 3] for first in (K.L_A, K.L_B, K.L_C))
    places = a.copy()
    flat = kinds == K.PARALLELOGRAM
    places[flat] += (b[flat] + c[flat]) / 2
    long = kinds == K.CYLINDER
    places[long] += b[long] * rows[long, K.L_LENGTH, None] / 2
    for light in np.flatnonzero(kinds == K.MESH):
        first, count = int(rows[light, K.L_FIRST]), int(rows[light, K.L_COUNT])
        corners = scene.light_corners[first : first + count].astype(np.float64)
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        areas = np.linalg.norm(across, axis=1)
        places[light] = np.average(corners.mean(axis=1), axis=0, weights=areas if areas.sum() > 0 else None)
    places[np.isin(kinds, NOWHERE)] = np.nan
    return places
