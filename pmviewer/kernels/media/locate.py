"""In which medium a point is: what the first boundary that a ray from there meets says of its side."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.accel.instance import stored_prim
from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.media.medium import MOST_BOUNDARIES, SAME
from pmviewer.kernels.memory import load_i4
from pmviewer.kernels.surface import leave, surface_at
from pmviewer.kernels.vector import dot

_f4 = np.float32
_i8 = np.int64
UNKNOWN = -2


@device
def medium_behind(scene, o, d):
    """The medium at o, UNKNOWN where no boundary is met in direction d. Surfaces that separate no media are passed."""
    for _ in range(MOST_BOUNDARIES):
        t, found, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], _f4(0.0), _f4(np.inf))
        prim = _i8(found)
        if prim < 0:
            return UNKNOWN
        p, ng, _, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
        at = _i8(2) * stored_prim(scene, prim)
        if load_i4(scene.prim_media, at) != SAME:
            beyond = dot(d, ng) < _f4(0.0)
            return _i8(load_i4(scene.prim_media, at + 1 if beyond else at))
        o = leave(p, ng, gap, d[0], d[1], d[2])
    return UNKNOWN


@kernel
def media_at(scenes, origins, directions, found):
    """The media at origins (n, 3), each asked in the direction (n, 3) of its own, into found (n,) int64: UNKNOWN where
    no boundary is met."""
    scene = scenes[0]
    for i in range(len(origins)):
        o = (origins[i, 0], origins[i, 1], origins[i, 2])
        d = (directions[i, 0], directions[i, 1], directions[i, 2])
        found[i] = medium_behind(scene, o, d)
