"""Reflected radiance from the photons around a point with any BSDF (E5).

    L(wo) = Σ f(wo, wi) · (n_s·wi)/(n_g·wi) · w(dᵢ/r) Φᵢ / (disc_mean · π r²)

Photons are those of `pmviewer.maps.estimate.estimate`, whose rules and searches these are. Photons measure the
irradiance of the real surface, whose normal is n_g; the quotient of cosines turns it into that of the surface that the
shading normal n_s pretends, so that the estimate agrees with light sampling and bumps show under any light.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf.scattering import FOLLOWED, bsdf_f, compressed, shading_normal
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import (
    count_trailing_zeros,
    float_of_bits,
    load_u4,
    stack_get_f4,
    stack_get_i4,
    stack_get_i8,
    stack_i4,
)
from pmviewer.kernels.vector import dot, normalize
from pmviewer.maps.estimate.filters import filter_disc_mean, filter_weight
from pmviewer.maps.estimate.nearest import Neighbours, nearest_disc
from pmviewer.maps.photon_words import decode_direction, decode_powers
from pmviewer.maps.search.disc import Disc, Place
from pmviewer.maps.search.grid import counted_in_block, grid_ranges
from pmviewer.maps.search.k_nearest import KEYS
from pmviewer.maps.search.simd import BLOCK_BYTES, ROW_BYTES, WIDTH
from pmviewer.maps.search.stored import stored_power

_f4 = np.float32
_f8 = np.float64
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32
_PI = _f8(np.pi)
GRAZING = _f4(1e-3)
"""Least n_g·wi that the quotient of cosines divides by: a bound on what one photon can become."""


@device
def reflected_share(b, group, n, wo, wi):
    """f of a group's lobes times the quotient of cosines for light from wi, at a surface with geometric normal n on the
    side of wi."""
    shading = dot(shading_normal(b), wi)
    f = bsdf_f(b, group, wo, wi)
    if group == FOLLOWED:
        shading = abs(shading)
        f = compressed(b, wo, wi, f)
    if shading <= _f4(0.0):
        return _f4(0.0), _f4(0.0), _f4(0.0)
    r, g, bl = f
    s = shading / max(dot(n, wi), min(GRAZING, shading))
    return r * s, g * s, bl * s


@device
def radiance_radius(grid, eye, radius, p, n, class_mask, b, group, flags, wo):
    """Radiance towards wo scattered at p by a group of lobes from all photons closer than `radius`.

    eye: EYE_DTYPE record (`flatness`, `filter`, `cone_k`); class_mask as for `irradiance_radius`.

    b is the BSDF of `pmviewer.kernels.bsdf.scattering`; n the geometric normal on the side where photons arrive. Only
    photons that have all of the `flags` (`pmviewer.maps.record`) count.
    """
    radius = min(radius, grid.radius)
    filter_kind, cone_k = eye.filter, eye.cone_k
    r2 = radius * radius
    inverse_r2 = _f4(1.0) / r2
    disc = Disc(p, n, r2, eye.flatness * radius, class_mask)
    ranges, squared = stack_i4(16), stack_i4(8)
    red, green, blue = _f8(0.0), _f8(0.0), _f8(0.0)
    for k in range(grid_ranges(grid, p[0], p[1], p[2], radius, ranges)):
        first, end = _i8(stack_get_i4(ranges, 2 * k)), _i8(stack_get_i4(ranges, 2 * k + 1))
        for block in range(first // WIDTH, (end - 1) // WIDTH + 1):
            mask = counted_in_block(grid, block, first, end, disc, squared)
            words = grid.blocks + block * BLOCK_BYTES + 3 * ROW_BYTES
            while mask != 0:
                lane = count_trailing_zeros(mask)
                mask &= mask - _i4(1)
                word = load_u4(words, lane)
                if _u4(word & flags) != flags:
                    continue
                f = reflected_share(b, group, n, wo, normalize(decode_direction(word)))
                w = filter_weight(filter_kind, cone_k, stack_get_f4(squared, lane) * inverse_r2)
                power = decode_powers(load_u4(words + ROW_BYTES, lane), load_u4(words + 2 * ROW_BYTES, lane))
                red += _f8(w * f[0] * power[0])
                green += _f8(w * f[1] * power[1])
                blue += _f8(w * f[2] * power[2])
    scale = _f8(grid.power_unit) / (_f8(filter_disc_mean(filter_kind, cone_k)) * _PI * _f8(radius) * _f8(radius))
    return _f4(red * scale), _f4(green * scale), _f4(blue * scale)


@device
def scattered_power(tree, place, n, b, group, flags, wo):
    """What the photon at a place of a tree adds to the radiance towards wo, see `radiance_knn`, in units of the map's
    power; nothing without all of the flags."""
    word = load_u4(tree.payload, 3 * place)
    if _u4(word & flags) != flags:
        return _f4(0.0), _f4(0.0), _f4(0.0)
    power = stored_power(tree, place)
    f = reflected_share(b, group, n, wo, normalize(decode_direction(word)))
    return f[0] * power[0], f[1] * power[1], f[2] * power[2]


@device
def radiance_knn(tree, eye, max_radius, p, n, class_mask, b, group, flags, wo):
    """The same from the `eye.k` nearest photons, whatever their flags, and the radius of their disc."""
    filter_kind, cone_k, rim = eye.filter, eye.cone_k, eye.rim
    keys = stack_i4(KEYS)
    neighbours = Neighbours(eye.k, max_radius, rim, eye.share)
    count, rim_place, r2 = nearest_disc(tree, Place(p, n, eye.flatness, class_mask), neighbours, keys)
    red, green, blue = _f8(0.0), _f8(0.0), _f8(0.0)
    for j in range(count):
        key = stack_get_i8(keys, j)
        w = filter_weight(filter_kind, cone_k, float_of_bits(_u4(key >> 32)) / r2)
        r, g, bl = scattered_power(tree, key & _i8(0xFFFFFFFF), n, b, group, flags, wo)
        red += _f8(w * r)
        green += _f8(w * g)
        blue += _f8(w * bl)
    if rim_place >= 0:
        w = _f4(0.5) * _f4(rim) * filter_weight(filter_kind, cone_k, _f4(1.0))
        r, g, bl = scattered_power(tree, rim_place, n, b, group, flags, wo)
        red += _f8(w * r)
        green += _f8(w * g)
        blue += _f8(w * bl)
    scale = _f8(tree.power_unit) / (_f8(filter_disc_mean(filter_kind, cone_k)) * _PI * _f8(r2))
    return (_f4(red * scale), _f4(green * scale), _f4(blue * scale)), np.sqrt(r2)
