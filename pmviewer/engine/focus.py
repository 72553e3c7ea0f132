"""Where a lens is focused that nobody has focused: on the surface in the middle of the picture."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pmviewer.kernels.accel.raycast import cast_closest
from pmviewer.render.camera import CameraPose
from pmviewer.scene.arrays.flatten import FlatScene


def focused(scene: FlatScene, camera: CameraPose) -> CameraPose:
    """The camera with a focus distance, if it has a lens."""
    if camera.aperture == 0 or camera.focus is not None:
        return camera
    return replace(camera, focus=distance_at(scene, camera, camera.width / 2, camera.height / 2))


def distance_at(scene: FlatScene, camera: CameraPose, x: float, y: float) -> float:
    """Distance along the view of the first surface at a place of the picture, in pixels; that of the camera's target
    where there is none."""
    origin, direction = (np.ascontiguousarray(part, np.float32) for part in camera.rays(np.array([x]), np.array([y])))
    along = float(direction[0] @ camera.axes()[2])
    near, far = (np.array([plane / along], np.float32) for plane in (camera.near, camera.far))
    t, prim, uv = np.empty(1, np.float32), np.empty(1, np.int32), np.empty((1, 2), np.float32)
    cast_closest(scene.record[0], origin, direction, near, far, t, prim, uv)
    found = float(t[0]) * along
    return found if prim[0] >= 0 and found > 0 else math.dist(camera.origin, camera.target)
