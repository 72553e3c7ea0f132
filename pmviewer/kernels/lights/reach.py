"""Whether a ray may meet a light at all, asked before it is cast.

Rays by a BSDF's lobes are half of direct light's multiple importance sampling (`pmviewer.render.direct.direct`), and
where nothing is gathered they look for lights alone. Most of them pass all lights far off: one box around whatever
emits tells it for a fraction of the price of a ray, and the picture stays the same bit for bit.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.media.medium import has_media

_f4 = np.float32
_LEAST = _f4(1e-20)
"""In place of a smaller component of a direction: its reciprocal is finite, and 0 · inf does not arise."""


@device
def _interval(p, d, low, high):
    """Where a line enters and leaves the slab between `low` and `high`."""
    if d < _f4(0.0):
        low, high = high, low
        d = min(d, -_LEAST)
    else:
        d = max(d, _LEAST)
    return (low - p) / d, (high - p) / d


@specialised
def may_meet_light(scene, p, d):
    """Whether a ray from the point p in the unit direction d may end at something that emits. In scenes with media,
    whose own light rays collect on their way, always."""
    if has_media(scene):
        return lambda scene, p, d: True

    def by_box(scene, p, d):
        x0, x1 = _interval(p[0], d[0], scene.lit_low_x, scene.lit_high_x)
        y0, y1 = _interval(p[1], d[1], scene.lit_low_y, scene.lit_high_y)
        z0, z1 = _interval(p[2], d[2], scene.lit_low_z, scene.lit_high_z)
        return max(max(x0, y0), max(z0, _f4(0.0))) <= min(x1, min(y1, z1))

    return by_box
