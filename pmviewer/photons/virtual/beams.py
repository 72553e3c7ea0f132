"""What a glossy virtual light scatters: the photons around it (R10, single step).

A weighted sum is a mean of what the lights send, f_y·Φ/q. A single photon on brushed metal sends a beam, many times as
bright as the metal is in the mean over photons, and a pixel that lies in the beam shows it. So a light that does not
scatter evenly stands for the nearest photons on its side of the surface, itself among them: it sends the mean of what
its BSDF makes of each. Where photons come to all of the disc alike, that has the same expectation; what the disc blurs
goes as it shrinks.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.memory import load_i4, stack_get_i8, stack_i4
from pmviewer.kernels.surface import face
from pmviewer.maps.search.disc import Facing
from pmviewer.maps.search.k_nearest import KEYS, nearest
from pmviewer.maps.search.stored import ALL_CLASSES
from pmviewer.maps.virtual_lights import FLATNESS, V_BEAMS, V_LAMBERTIAN, V_N, V_P, V_PHI, V_WI

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64


@kernel
def beams_at(trees, candidates, lights, reach, share, beams, first, last):
    """The photons around each of the lights first … last−1 that do not scatter evenly.

    trees: record (1,) of a kd-tree of the candidates' photons; candidates: float32 (m, COLUMNS); lights: float32 (n,
    COLUMNS), their number goes into V_BEAMS; reach: largest radius; share: float32 (n,), what a candidate's power is
    multiplied by where the light stands for it; beams: float32 (n, k, BEAM), filled in with directions to where they
    come from and powers over their number.
    """
    tree = trees[0]
    keys = stack_i4(KEYS)
    most = beams.shape[1]
    for i in range(first, last):
        row = lights[i]
        row[V_BEAMS] = _f4(0.0)
        if row[V_LAMBERTIAN] != _f4(0.0):
            continue
        p = row[V_P], row[V_P + 1], row[V_P + 2]
        wi = row[V_WI], row[V_WI + 1], row[V_WI + 2]
        n = face((row[V_N], row[V_N + 1], row[V_N + 2]), wi)
        facing = Facing(n, _f4(1.0) / (FLATNESS * FLATNESS), _i4(ALL_CLASSES))
        count, _ = nearest(tree, p, most, reach * reach, keys, facing)
        for j in range(count):
            place = stack_get_i8(keys, j) & _i8(0x7FFFFFFF)
            other = candidates[load_i4(tree.index, place)]
            beam = beams[i, j]
            for k in range(3):
                beam[k] = other[V_WI + k]
                beam[3 + k] = other[V_PHI + k] * share[i] / _f4(count)
        row[V_BEAMS] = _f4(count)
