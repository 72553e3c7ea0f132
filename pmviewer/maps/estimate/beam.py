"""The beam radiance estimate: light that photons in a medium scatter towards a whole ray at once (E7).

Jarosz, Zwicker and Jensen 2008, with one radius for all photons, but on lattices (`pmviewer.maps.estimate.reach`): each
photon within r of the ray adds its scattered power Φ times the phase function towards the ray, through the medium from
its foot on the ray, over the disc π r²:

    L = Σ T(tᵢ) p(dᵢ → −d) Φᵢ / (π r²)

What is left of a march along the ray with look-ups is its noise: no photon is looked up twice, and none is missed.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.media.column import through
from pmviewer.kernels.media.phase import phase
from pmviewer.kernels.memory import load_u4
from pmviewer.kernels.vector import dot, normalize, sub
from pmviewer.maps.estimate.reach import more_in_disc, reach2_of
from pmviewer.maps.photon_words import decode_direction, decode_powers
from pmviewer.maps.search.along_ray import cells_of, is_in_cell, photon_place, photons_of_row, slabs_of
from pmviewer.maps.search.simd import ROW_BYTES

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64


@device
def _one(scene, grid, i, o, d, length, r2, paths, column, lobes):
    """What photon i adds, and whether it is within the radius; the powers in units of the map's."""
    block, lane, p = photon_place(grid, i)
    offset = sub(p, o)
    t = dot(offset, d)
    if not (t >= _f4(0.0) and t < length):
        return False, _f4(0.0), _f4(0.0), _f4(0.0)
    apart = (offset[0] - t * d[0], offset[1] - t * d[1], offset[2] - t * d[2])
    apart2 = dot(apart, apart)
    if not apart2 < r2:
        return False, _f4(0.0), _f4(0.0), _f4(0.0)
    reach2 = reach2_of(scene, column, p, r2, paths)
    if not apart2 < reach2:
        return False, _f4(0.0), _f4(0.0), _f4(0.0)
    wi = normalize(decode_direction(load_u4(block + 3 * ROW_BYTES, lane)))
    red, green, blue = decode_powers(load_u4(block + 4 * ROW_BYTES, lane), load_u4(block + 5 * ROW_BYTES, lane))
    # It travels along −wi and is scattered along −d: the same angle as from d to wi.
    f = phase(lobes, d, wi) * more_in_disc(column, r2, reach2)
    T = through(scene, column, t)
    return True, f * red * T[0], f * green * T[1], f * blue * T[2]


@device
def beam_radiance(scene, grid, o, d, length, radius, paths, column, lobes):
    """Radiance (red, green, blue) at o that photons send back along a ray of that length, unit direction d, through a
    medium of that column (`pmviewer.kernels.media.column`) and phase function `lobes`, and the number of photons that
    it is from. grid: record of a PhotonGrid; a radius above the grid's own is lowered to it; paths: the most it is on
    lattices, in free paths at a photon."""
    radius = min(radius, grid.radius)
    r2 = radius * radius
    slabs = slabs_of(grid, o, d, length, radius)
    red, green, blue = _f8(0.0), _f8(0.0), _f8(0.0)
    count = _i8(0)
    hashed = grid.hash_mask != 0
    for slab in range(slabs.first, slabs.last + 1):
        x0, x1 = cells_of(grid, slabs, slab, length, 0)
        y0, y1 = cells_of(grid, slabs, slab, length, 1)
        z0, z1 = cells_of(grid, slabs, slab, length, 2)
        step = _i8(1) if hashed else max(x1 - x0 + 1, _i8(1))
        for z in range(z0, z1 + 1):
            for y in range(y0, y1 + 1):
                for x in range(x0, x1 + 1, step):
                    first, end = photons_of_row(grid, x, x + step - 1, y, z)
                    for i in range(first, end):
                        if hashed:
                            _, _, p = photon_place(grid, i)
                            if not is_in_cell(grid, p, x, y, z):
                                continue
                        near, r, g, b = _one(scene, grid, i, o, d, length, r2, paths, column, lobes)
                        if near:
                            count += 1
                            red += _f8(r)
                            green += _f8(g)
                            blue += _f8(b)
    scale = _f8(grid.power_unit) / (_f8(math.pi) * _f8(r2))
    return (_f4(red * scale), _f4(green * scale), _f4(blue * scale)), count
