"""Where a lens is focused that nobody has focused: on the surface in the middle of the picture."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pmviewer.render.camera import CameraPose

if TYPE_CHECKING:  # numba, which the window doesn't wait for
    from pmviewer.scene.arrays.flatten import FlatScene

NEAREST = 1e-12
"""Of focus distances relative to the lens's radius: nearer ones make the same picture, all rays being sideways, and
float32 overflows."""


def focused(scene: FlatScene, camera: CameraPose) -> CameraPose:
    """The camera with a focus distance, if it has a lens."""
    if camera.aperture == 0:
        return camera
    focus = camera.focus
    if focus is None:
        focus = distance_at(scene, camera, camera.width / 2, camera.height / 2)
    return replace(camera, focus=max(focus, NEAREST * camera.aperture))


def distance_at(scene: FlatScene, camera: CameraPose, x: float, y: float) -> float:
    """Distance along the view of the first surface at a place of the picture, in pixels; that of the camera's target
    where there is none."""
    point = surface_at(scene, camera, x, y)
    found = float(camera.project(point[None])[0, 2]) if point is not None else 0.0
    return found if found > 0 else math.dist(camera.origin, camera.target)


def surface_at(scene: FlatScene, camera: CameraPose, x: float, y: float) -> NDArray[np.float64] | None:
    """The point (3,) of the first surface at a place of the picture, in pixels, for a pinhole; None where there is
    none."""
    from pmviewer.render.closest_hits import closest_hits

    origins, directions = camera.rays(np.array([x]), np.array([y]))
    near, far = camera.seen_from(origins, directions), camera.far / (directions @ camera.axes()[2])
    hits = closest_hits(scene.record[0], origins, directions, far, near)
    return np.asarray(hits.origins[0] + hits.t[0] * hits.directions[0], float) if hits.prims[0] >= 0 else None
