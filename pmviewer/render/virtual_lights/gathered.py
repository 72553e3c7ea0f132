"""What a gather ray brings, by the photons that virtual lights are chosen from (R10, single step).

A narrow lobe holds few virtual lights, and ΣF/ΣG is the radiance of these few. The gather rays that normalise the sums
follow the lobe. Each is as good as a virtual light at its end that was chosen with the very density that weights divide
by: it adds the radiance there to ΣF, and to ΣG what it counts. Whatever share n gather rays have in both sums, and the
lights the rest, the sums keep their means. It is n/(n + IN_A_LOBE), as if so many lights lay in a lobe.
The mean of ΣF is a little too small beside edges: discs are taken whole there (docs/virtual.md).

The radiance is the density estimate of the nearest photons on that side, the farthest left out, in a disc that shrinks
as that of the lights does. Where no photon lies within the largest radius, the ray counts nothing: there the lights
weigh nothing, either (`pmviewer.photons.virtual.density`).
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.bsdf.scattering import STORED
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import absent, part, specialised
from pmviewer.kernels.memory import float_of_bits, load_u4, stack_get_i8, stack_i4
from pmviewer.kernels.vector import add, mul, normalize, scale
from pmviewer.maps.estimate.glossy import reflected_share
from pmviewer.maps.photon_words import decode_direction
from pmviewer.maps.search.disc import Facing
from pmviewer.maps.search.k_nearest import KEYS, nearest
from pmviewer.maps.search.stored import ALL_CLASSES, stored_power
from pmviewer.maps.virtual_lights import FLATNESS
from pmviewer.render.chain import BLACK

IN_A_LOBE = 4
"""Measured with rough metal and 200 lights (docs/virtual.md)."""

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32


@specialised
def lit_by_photons(given, si, brings):
    """1 where photons lie around a surface or no map tells, else 0; and if a ray `brings` light, the radiance that the
    surface sends towards wo by them."""
    if absent(part(given, "virtual_map")):
        return lambda given, si, brings: (_f4(1.0), BLACK)
    return lambda given, si, brings: _by_nearest(given, si, brings)


@device
def _scattered(tree, place, si):
    """What a photon of the map adds to the radiance towards wo, in units of the map's power."""
    wi = normalize(decode_direction(load_u4(tree.arrivals, place)))
    return mul(reflected_share(si.bsdf, STORED, si.ng, si.wo, wi), stored_power(tree, place))


@device
def _by_nearest(given, si, brings):
    tree, virtual = given.virtual_map, given.virtual
    if virtual.k == 0:
        return _f4(1.0), BLACK
    keys = stack_i4(KEYS)
    facing = Facing(si.ng, _f4(1.0) / (FLATNESS * FLATNESS), _i4(ALL_CLASSES))
    k = virtual.k if brings else _i4(1)
    count, r2 = nearest(tree, si.p, k, virtual.reach * virtual.reach, keys, facing)
    if count == 0:
        return _f4(0.0), BLACK
    total = BLACK
    if brings:
        for j in range(count):
            key = stack_get_i8(keys, j)
            if count < k or float_of_bits(_u4(key >> 32)) < r2:
                total = add(total, _scattered(tree, key & _i8(0xFFFFFFFF), si))
    return _f4(1.0), scale(total, _f4(tree.power_unit) / (_f4(math.pi) * r2))
