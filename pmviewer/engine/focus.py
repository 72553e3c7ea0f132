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
    from pmviewer.kernels.accel.raycast import cast_closest

    origin, direction = (np.ascontiguousarray(part, np.float32) for part in camera.rays(np.array([x]), np.array([y])))
    forward = camera.axes()[2]
    near = camera.seen_from(origin, direction).astype(np.float32)
    far = np.array([camera.far / float(direction[0] @ forward)], np.float32)
    t, prim, uv = np.empty(1, np.float32), np.empty(1, np.int32), np.empty((1, 2), np.float32)
    cast_closest(scene.record[0], origin, direction, near, far, t, prim, uv)
    return np.asarray(origin[0] + t[0] * direction[0], float) if prim[0] >= 0 else None
