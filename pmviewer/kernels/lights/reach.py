"""Whether rays by a BSDF's lobes, half of direct light's multiple importance sampling
(`pmviewer.render.direct.direct`), have anything to find that samples of lights have not.

Where nothing is gathered they look for lights alone. Most of them pass all lights far off: one box around whatever
emits tells it for a fraction of the price of a ray, and the picture stays the same bit for bit. And on a Lambertian
surface that is far from all lights, the heuristic leaves them next to nothing: there direct light is that of light
samples alone, unbiased since the place decides and no random number.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.media.medium import has_media

_f4 = np.float32
_LEAST = _f4(1e-20)
"""In place of a smaller component of a direction: its reciprocal is finite, and 0 · inf does not arise."""
LEAST_RATIO = _f4(10.0 / math.pi)
"""Ten times the density of a diffuse lobe at its peak: where all light samples are as dense as that, the power
heuristic leaves at most a hundredth of any light to the BSDF's rays."""


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


@device
def _outside(x, low, high):
    """How far x lies outside an interval."""
    return max(max(low - x, x - high), _f4(0.0))


@device
def samples_by_power_suffice(scene, n, p):
    """Whether n samples of lights, chosen by power, find direct light at the point p of a Lambertian surface as well
    alone. A sample of a light of area A and probability P has a density of at least n·P·d²/A over directions, d being
    the distance to the box; `lit_spread` is the largest A/P."""
    x = _outside(p[0], scene.lit_low_x, scene.lit_high_x)
    y = _outside(p[1], scene.lit_low_y, scene.lit_high_y)
    z = _outside(p[2], scene.lit_low_z, scene.lit_high_z)
    return _f4(n) * (x * x + y * y + z * z) >= LEAST_RATIO * scene.lit_spread
