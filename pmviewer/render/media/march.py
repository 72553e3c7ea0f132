"""Ray marching through the volume map: look-ups at places along a ray, evenly apart (E7).

Jensen & Christensen 1998. The first place is drawn at random within the first step, and the others follow at equal
steps, so that the sum over the places is right in the mean for any step (the source's steps are not random as a whole).
Only what lies within reach of photons is walked through. What kernels need to know stands in the map's record, whose
mark `march` also says that they march.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.media.column import through
from pmviewer.kernels.memory import stack_i4
from pmviewer.kernels.vector import along
from pmviewer.maps.estimate.ball import ball_radiance, nearest_ball_radiance
from pmviewer.maps.search.k_nearest import KEYS
from pmviewer.maps.variant import is_kdtree, with_mark

MOST_STEPS = 4096
"""Of a stretch in one medium; longer ones have wider steps."""
_FIELDS: list[tuple[str, Any]] = [
    ("march_step", np.float32),  # in scene units
    ("volume_k", np.int32),
    ("volume_share", np.float32),  # of the ball of the k nearest, in which they count
    *[(f"{end}_{axis}", np.float32) for end in ("low", "high") for axis in "xyz"],  # box of the photons
]
_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
_BLACK = (_f4(0.0), _f4(0.0), _f4(0.0))


def march_record(
    record: NDArray[np.void], step: float, k: int, share: float, box: NDArray[np.float64]
) -> NDArray[np.void]:
    """The record (1,) of a grid or kd-tree of photons for ray marching by steps of that length in scene units. k,
    share: of kd-trees. box: (2, 3), that of the photons. Valid while the map lives."""
    marching = np.zeros(1, with_mark(record.dtype, "march", _FIELDS))
    for name in record.dtype.names or ():
        marching[name] = record[name]
    marching["march"], marching["march_step"] = 1, step
    marching["volume_k"], marching["volume_share"] = k, share
    for end, corner in zip(("low", "high"), box, strict=True):
        for axis, value in zip("xyz", corner, strict=True):
            marching[f"{end}_{axis}"] = value
    return marching


def marches(photons: Any) -> bool:
    """Whether a record of the volume map, or its type, is looked up by ray marching."""
    return has(photons, "march")


@device
def _within(photons, o, d, length, radius):
    """From where to where a ray is so near to the box of the photons; empty where it is not."""
    near, far = _f8(0.0), _f8(length)
    low = (photons.low_x, photons.low_y, photons.low_z)
    high = (photons.high_x, photons.high_y, photons.high_z)
    for k in range(3):
        a, b = _f8(low[k]) - _f8(radius) - _f8(o[k]), _f8(high[k]) + _f8(radius) - _f8(o[k])
        if d[k] != _f4(0.0):
            a, b = a / _f8(d[k]), b / _f8(d[k])
            near, far = max(near, min(a, b)), min(far, max(a, b))
        elif a > 0.0 or b < 0.0:
            far = _f8(-1.0)
    return near, far


@specialised
def _looked_up(scene, photons, p, d, radius, paths, column, lobes, keys):
    """Radiance per length that photons around p scatter along the ray."""
    if is_kdtree(photons):

        def by_nearest(scene, photons, p, d, radius, paths, column, lobes, keys):
            k, share = photons.volume_k, photons.volume_share
            L, _ = nearest_ball_radiance(scene, photons, p, d, radius, paths, k, share, column, lobes, keys)
            return L

        return by_nearest

    def by_radius(scene, photons, p, d, radius, paths, column, lobes, keys):
        L, _ = ball_radiance(scene, photons, p, d, radius, paths, column, lobes)
        return L

    return by_radius


@specialised
def _scratch(photons):
    """For neighbours, where there are any."""
    if is_kdtree(photons):
        return lambda photons: stack_i4(KEYS)
    return lambda photons: stack_i4(1)


@device
def marched_radiance(scene, photons, o, d, length, radius, paths, column, lobes, u):
    """Radiance (red, green, blue) at o that photons scatter back along a ray of that length, unit direction d, through
    a medium of that column (`pmviewer.kernels.media.column`) and phase function `lobes`. photons: a `march_record`;
    paths: the most that the radius is on lattices, in free paths at a photon; u: in [0, 1), where in its step each
    place is."""
    near, far = _within(photons, o, d, length, radius)
    if photons.n == 0 or not near < far or not photons.march_step > _f4(0.0):
        return _BLACK
    keys = _scratch(photons)
    n = max(_i8(math.ceil(min((far - near) / _f8(photons.march_step), _f8(MOST_STEPS)))), _i8(1))
    step = (far - near) / n
    red, green, blue = _f8(0.0), _f8(0.0), _f8(0.0)
    for j in range(n):
        t = _f4(near + (_f8(j) + _f8(u)) * step)
        L = _looked_up(scene, photons, along(o, d, t), d, radius, paths, column, lobes, keys)
        if L[0] > _f4(0.0) or L[1] > _f4(0.0) or L[2] > _f4(0.0):
            T = through(scene, column, t)
            red += _f8(L[0]) * _f8(T[0])
            green += _f8(L[1]) * _f8(T[1])
            blue += _f8(L[2]) * _f8(T[2])
    return _f4(red * step), _f4(green * step), _f4(blue * step)
