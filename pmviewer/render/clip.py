"""The render camera's clipping plane: it leaves out what lies on the camera's side of it (`camera.clip`)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.render.camera import CameraPose
from pmviewer.settings.schema.camera import CameraSettings


def clipped(camera: CameraPose, settings: CameraSettings, center: NDArray[np.floating], radius: float) -> CameraPose:
    """The camera with its clipping plane as near plane, if it has one; `center` (3,) and `radius` bound the scene.

    Across an axis the camera's side of the plane is left out, whichever that is; a plane across the view that lies
    behind the camera leaves nothing out but what is before the file's own near plane.
    """
    if settings.clip == "off":
        return camera
    normal = camera.axes()[2] if settings.clip == "view" else np.eye(3)["xyz".index(settings.clip)]
    away = float(np.subtract(center, camera.origin) @ normal) + settings.clip_at * radius
    if settings.clip == "view":
        facing, near = normal, max(away, camera.near)
    else:
        facing, near = (normal if away >= 0 else -normal), abs(away)
    return replace(camera, near=near, near_normal=(float(facing[0]), float(facing[1]), float(facing[2])))
