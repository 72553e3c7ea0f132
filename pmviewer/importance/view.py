"""Importance and what rules make of it at what the camera sees, pixel by pixel, for the views (I3, I4)."""

from __future__ import annotations

import numpy as np

from pmviewer.importance.rules import NEAREST
from pmviewer.kernels.compile.jit import kernel
from pmviewer.maps.importance.look_up import importance_at, importance_sum
from pmviewer.render.diagnostics.diagnostics import stored_hit

CHANNELS = 2
"""Importance in pixels, and photons required, per unit area."""

_f4 = np.float32
_i4 = np.int32


@kernel
def importance_view(scenes, eyes, maps, M_r, constant, out, first, last):
    """Importance and required density at the first surface seen through the middle of pixels first … last−1 that stores
    photons; −1 where there is none.

    scenes: SCENE_DTYPE (1,); eyes: EYE_DTYPE (1,); maps: record (1,) of an importance map; M_r: float32, photons wanted
    per pixel; constant: float32, the density required everywhere instead, in photons per unit area, where it is not
    negative; out: float32 (pixels, CHANNELS).
    """
    scene, eye, importance = scenes[0], eyes[0], maps[0]
    for pixel in range(first, last):
        hit, ng, _ = stored_hit(scene, eye, pixel)
        out[pixel, 0] = out[pixel, 1] = _f4(-1.0)
        if hit.prim >= 0:
            gamma = importance_at(importance, hit.p, ng)
            out[pixel, 0], out[pixel, 1] = gamma, constant if constant >= _f4(0.0) else gamma * M_r


@kernel
def probability_view(scenes, eyes, maps, f, epsilon, discard, out, first, last):
    """Probability with which `pmviewer.photons.deposition.rules.KellerWald` stores a photon that arrives at the first
    surface seen through the middle of pixels first … last−1 that stores photons; −1 where there is none.

    f: float32, by pixel; epsilon: float32, the cut-off, below which the probability is epsilon or, with `discard`, 0;
    out: float32 (pixels, 1); the rest as for `importance_view`.
    """
    scene, eye, importance = scenes[0], eyes[0], maps[0]
    for pixel in range(first, last):
        hit, ng, _ = stored_hit(scene, eye, pixel)
        out[pixel, 0] = _f4(-1.0)
        if hit.prim >= 0:
            q = f * importance_sum(importance, hit.p, ng, _i4(NEAREST))
            if not q >= epsilon:
                q = _f4(0.0) if discard else epsilon
            out[pixel, 0] = min(q, _f4(1.0))
