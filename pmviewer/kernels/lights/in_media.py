"""Which media photons of the lights start in, and how much of what media emit there is."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.dimensions import EMISSION
from pmviewer.kernels.lights.light import emit_from
from pmviewer.kernels.media.locate import medium_behind
from pmviewer.kernels.random import INDEPENDENT, SOBOL, draw4
from pmviewer.kernels.vector import largest

_f4 = np.float32
_i8 = np.int64
_u4 = np.uint32


@kernel
def media_of_lights(scenes, found):
    """The media that photons of each light start in, of as many photons as found (n_lights, m) int64 has columns."""
    scene = scenes[0]
    for light in range(found.shape[0]):
        for j in range(found.shape[1]):
            u0, u1, u2, u3 = draw4(INDEPENDENT, _u4(light), _u4(j), EMISSION)
            p, d, _ = emit_from(scene, _i8(light), (u0, u1), (u2, u3))
            found[light, j] = medium_behind(scene, p, d)


@kernel
def shares_in_media(scenes, first, photons, shares):
    """Of glows, the lights from number `first` on: the share of so many photons that start in their medium, into
    shares (n,) float64."""
    scene = scenes[0]
    for k in range(len(shares)):
        inside = 0
        for j in range(photons):
            u0, u1, u2, u3 = draw4(SOBOL, _u4(k), _u4(j), EMISSION)
            _, _, beta = emit_from(scene, _i8(first + k), (u0, u1), (u2, u3))
            if largest(beta) > _f4(0.0):
                inside += 1
        shares[k] = inside / photons
