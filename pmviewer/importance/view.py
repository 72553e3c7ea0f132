"""Importance and required density at what the camera sees, pixel by pixel, for the views (I3)."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.jit import kernel
from pmviewer.maps.importance import importance_at
from pmviewer.render.diagnostics import stored_hit

CHANNELS = 2
"""Importance in pixels, and photons required, per unit area."""

_f4 = np.float32


@kernel
def importance_view(scenes, eyes, maps, M_r, out, first, last):
    """Importance and required density at the first surface seen through the middle of pixels first … last−1 that stores
    photons; −1 where there is none.

    scenes: SCENE_DTYPE (1,); eyes: EYE_DTYPE (1,); maps: record (1,) of an importance map; M_r: float32, photons wanted
    per pixel; out: float32 (pixels, CHANNELS).
    """
    scene, eye, importance = scenes[0], eyes[0], maps[0]
    for pixel in range(first, last):
        prim, _, _, p, ng, _, _, _ = stored_hit(scene, eye, pixel)
        out[pixel, 0] = out[pixel, 1] = _f4(-1.0)
        if prim >= 0:
            gamma = importance_at(importance, p, ng)
            out[pixel, 0], out[pixel, 1] = gamma, gamma * M_r
