"""What a gather ray brings, by the photons that virtual lights are chosen from (R10, single step).

A narrow lobe holds few virtual lights, and ΣF/ΣG is the radiance of these few. The gather rays that normalise the sums
follow the lobe. Each is as good as a virtual light at its end that was chosen with the very density that weights divide
by: it adds the radiance there to ΣF, and to ΣG what it counts. Whatever share n gather rays have in both sums, and the
lights the rest, the sums keep their means. It is n/(n + IN_A_LOBE), as if so many lights lay in a lobe.

The radiance is the density estimate of the nearest photons on that side, the farthest left out, in the part of a disc
that lies on the surface. Beside edges that is not all of it: by m places of the disc, h of them on the surface, the
light of the whole disc counts (m + 1)/(h + 1) times, whose mean is (1 − (1 − c)^(m+1))/c for a part c. Discs shrink as
those of the lights do. Where no photon lies within the largest radius, the ray counts nothing: there the lights
weigh nothing, either (`pmviewer.photons.virtual.density`), nor where the photon hides that its end belongs to.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.bsdf.scattering import STORED
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import absent, part, specialised
from pmviewer.kernels.dimensions import GATHERED_SALT
from pmviewer.kernels.memory import float_of_bits, load_u4, stack_get_i8, stack_i4
from pmviewer.kernels.random import hash3, unit_float
from pmviewer.kernels.vector import add, along, basis, luminance, mul, normalize, scale
from pmviewer.maps.estimate.glossy import reflected_share
from pmviewer.maps.photon_words import decode_direction
from pmviewer.maps.search.disc import Facing
from pmviewer.maps.search.k_nearest import KEYS, nearest
from pmviewer.maps.search.stored import ALL_CLASSES, stored_place, stored_power
from pmviewer.maps.together import beside, see_each_other
from pmviewer.maps.virtual_lights import FLATNESS
from pmviewer.render.chain import BLACK

PLACES = 2
"""Of a disc that are asked whether they lie on the surface."""
IN_A_LOBE = 4
"""Measured with rough metal and 200 lights (docs/virtual.md)."""

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32


@specialised
def lit_by_photons(given, si, pixel, index, brings):
    """1 where photons lie around a surface or no map tells, else 0; and if a ray `brings` light, the radiance that the
    surface sends towards wo by them."""
    if absent(part(given, "virtual_map")):
        return lambda given, si, pixel, index, brings: (_f4(1.0), BLACK)
    return lambda given, si, pixel, index, brings: _by_nearest(given, si, pixel, index, brings)


@device
def _scattered(tree, place, si):
    """What a photon of the map adds to the radiance towards wo, in units of the map's power."""
    wi = normalize(decode_direction(load_u4(tree.arrivals, place)))
    return mul(reflected_share(si.bsdf, STORED, si.ng, si.wo, wi), stored_power(tree, place))


@device
def _over_part(given, si, r2, pixel, index):
    """1 over the part of the disc of squared radius r2 that lies on the surface and is seen from its middle, but for
    what the head of this file says: (m + 1)/(h + 1), h of m random places."""
    scene, n = given.scene, si.ng
    radius = _f4(math.sqrt(r2))
    height, down = FLATNESS * radius, scale(n, _f4(-1.0))
    s, t = basis(n)
    phi = unit_float(hash3(pixel.seed, index, _u4(GATHERED_SALT)))
    where = unit_float(hash3(pixel.seed, index, _u4(GATHERED_SALT) + _u4(1)))
    there = _i4(0)
    for i in range(PLACES):
        # One in each ring of the same area, on opposite sides.
        r = radius * _f4(math.sqrt((_f4(i) + where) / _f4(PLACES)))
        angle = _f4(2.0 * math.pi) * (phi + _f4(i) / _f4(PLACES))
        x = along(along(si.p, s, r * _f4(math.cos(angle))), t, r * _f4(math.sin(angle)))
        top = along(x, n, height)
        far, prim, u, v = closest_hit(
            scene, top[0], top[1], top[2], down[0], down[1], down[2], _f4(0.0), _f4(2.0) * height
        )
        if prim < 0:
            continue
        cos, _, _ = beside(scene, (prim, u, v, top, down, far), (si.p, n, si.gap), given.eye.glossy)
        if cos > _f4(0.0):
            there += _i4(1)
    return _f4(PLACES + 1) / _f4(there + 1)


@device
def _belongs(given, si, keys, found, pixel, index):
    """Whether the surface belongs to one of the nearest photons, drawn by chance: something may hide it.
    `found`: how many there are, the squared distance of the farthest, and whether that one is not among those."""
    tree = given.virtual_map
    count, r2, but_one = found
    among = _f4(count) - (_f4(1.0) if but_one else _f4(0.0))
    j = min(_i8(unit_float(hash3(pixel.seed, index, _u4(GATHERED_SALT) + _u4(2))) * among), _i8(among) - 1)
    if but_one and not float_of_bits(_u4(stack_get_i8(keys, j) >> 32)) < r2:
        j = count - 1
    place = stack_get_i8(keys, j) & _i8(0xFFFFFFFF)
    n = normalize(decode_direction(load_u4(tree.payload, 3 * place)))
    return see_each_other(given.scene, si.p, si.ng, stored_place(tree, place), n, si.gap)


@device
def _by_nearest(given, si, pixel, index, brings):
    tree, virtual = given.virtual_map, given.virtual
    if virtual.k == 0:
        return _f4(1.0), BLACK
    keys = stack_i4(KEYS)
    facing = Facing(si.ng, _f4(1.0) / (FLATNESS * FLATNESS), _i4(ALL_CLASSES))
    # Without the farthest, which ends the disc, there are as many as a place belongs to.
    k = virtual.k if brings else virtual.k - _i4(1)
    count, r2 = nearest(tree, si.p, k, virtual.reach * virtual.reach, keys, facing)
    if count == 0:
        return _f4(0.0), BLACK
    if not _belongs(given, si, keys, (count, r2, brings and count == k), pixel, index):
        return _f4(0.0), BLACK
    total = BLACK
    if brings:
        for j in range(count):
            key = stack_get_i8(keys, j)
            if count < k or float_of_bits(_u4(key >> 32)) < r2:
                total = add(total, _scattered(tree, key & _i8(0xFFFFFFFF), si))
    if not luminance(total) > _f4(0.0):
        return _f4(1.0), BLACK
    around = _over_part(given, si, r2, pixel, index)
    return _f4(1.0), scale(total, around * _f4(tree.power_unit) / (_f4(math.pi) * r2))
