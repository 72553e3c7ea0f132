"""Shading under false colours, so that a picture of numbers shows whose numbers they are."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

DARKEST = 0.2
"""Of a surface that is seen edge-on."""


class View(Protocol):
    """What shading reads of `pmviewer.render.camera.CameraPose`."""

    @property
    def origin(self) -> tuple[float, float, float]:
        """The eye."""

    @property
    def target(self) -> tuple[float, float, float]:
        """What it looks at."""


def shades(normals: NDArray[np.floating], camera: View) -> NDArray[np.float32]:
    """(h, w) in DARKEST to 1: how much the surfaces of these normals (h, w, 3) face a light far behind the camera; 1
    where there is no surface."""
    towards = np.subtract(camera.origin, camera.target, dtype=float)
    direction = towards / max(float(np.linalg.norm(towards)), 1e-300)
    known = np.nan_to_num(normals, posinf=0.0, neginf=0.0)
    facing = np.minimum(np.abs(known @ direction), 1.0)
    seen = np.any(known != 0, axis=-1)
    return np.where(seen, DARKEST + (1 - DARKEST) * facing, 1.0).astype(np.float32)


def shaded(pixels: NDArray[np.float32], shade: NDArray[np.float32], strength: float) -> NDArray[np.float32]:
    """Colours (h, w, 3) darkened by shades (h, w); `strength` 0 leaves them as they are."""
    return (pixels * (1 + np.float32(strength) * (shade[..., None] - 1))).astype(np.float32)
