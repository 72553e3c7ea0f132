"""The beam radiance estimate: light that photons in a medium scatter towards a whole ray at once (E7).

Jarosz, Zwicker and Jensen 2008, with one radius for all photons, but on lattices (`pmviewer.maps.estimate.reach`): each
photon within r of the ray adds its scattered power Φ times the phase function towards the ray, through the medium from
where the ray meets the photon's disc, over the disc's area π r² as the ray sees it:

    L = Σ T(tᵢ) p(dᵢ → −d) Φᵢ / (π r² |nᵢ·d|)

What is left of a march along the ray with look-ups is its noise: no photon is looked up twice, and none is missed.

Discs lie across the ray, nᵢ = d, as the paper has them, but for those near the surfaces at its ends. There they would
reach out of the medium, where no photons are, and find too little at the very depth that a dense medium is seen at; a
disc along the surface lies at one depth, within the medium and in light of one brightness.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.media.column import through
from pmviewer.kernels.media.phase import phase
from pmviewer.kernels.memory import count_trailing_zeros, load_u4
from pmviewer.kernels.vector import along, dot, normalize, sub
from pmviewer.maps.estimate.reach import more_in_disc, reach2_of
from pmviewer.maps.photon_words import decode_direction, decode_powers
from pmviewer.maps.search.along_ray import cells_of, is_in_cell, photon_place, photons_of_row, slabs_of
from pmviewer.maps.search.grid import lanes_between
from pmviewer.maps.search.simd import BLOCK_BYTES, ROW_BYTES, WIDTH, beside8

_f4 = np.float32
_f8 = np.float64
_i4 = np.int32
_i8 = np.int64
_NOTHING = (_f4(0.0), _f4(0.0), _f4(0.0))


class Beam(NamedTuple):
    """A stretch of a ray: from o in the unit direction d, its length; the unit normals of discs in its `first` part, up
    to the distance `a`, and in its `last`, from b on; between them discs lie across it. Behind the distance `sure` it
    is looked at by a chance that falls as exp(−rate (t − sure))."""

    o: Any
    d: Any
    length: Any
    first: Any
    last: Any
    a: Any
    b: Any
    sure: Any
    rate: Any


@device
def _one(scene, place, beam, r2, paths, column, lobes):
    """What the photon at a `photon_place` adds, in units of the map's power, and whether it counts."""
    _, _, p = place
    offset = sub(p, beam.o)
    c0, c1 = _f4(1.0) / dot(beam.first, beam.d), _f4(1.0) / dot(beam.last, beam.d)
    t0, t, t1 = dot(offset, beam.first) * c0, dot(offset, beam.d), dot(offset, beam.last) * c1
    counts, total = False, _NOTHING
    # Where discs of two kinds cross, a photon may have a part in both, as its neighbour across the ray has in none.
    if t0 >= _f4(0.0) and t0 < beam.a:
        counts, total = _in_disc(scene, place, offset, beam, t0, c0, r2, paths, column, lobes)
    if t >= beam.a and t < beam.b:
        more, L = _in_disc(scene, place, offset, beam, t, _f4(1.0), r2, paths, column, lobes)
        counts, total = counts or more, (total[0] + L[0], total[1] + L[1], total[2] + L[2])
    if t1 >= beam.b and t1 < beam.length:
        more, L = _in_disc(scene, place, offset, beam, t1, c1, r2, paths, column, lobes)
        counts, total = counts or more, (total[0] + L[0], total[1] + L[1], total[2] + L[2])
    return counts, total


@device
def _in_disc(scene, place, offset, beam, t, slant, r2, paths, column, lobes):
    """What a photon adds whose disc the ray meets at the distance t; `slant`: 1 over the cosine between them."""
    block, lane, p = place
    d = beam.d
    apart = (offset[0] - t * d[0], offset[1] - t * d[1], offset[2] - t * d[2])
    apart2 = dot(apart, apart)
    if not apart2 < r2:
        return False, _NOTHING
    reach2 = reach2_of(scene, column, p, r2, paths)
    if not apart2 < reach2:
        return False, _NOTHING
    wi = normalize(decode_direction(load_u4(block + 3 * ROW_BYTES, lane)))
    red, green, blue = decode_powers(load_u4(block + 4 * ROW_BYTES, lane), load_u4(block + 5 * ROW_BYTES, lane))
    # It travels along −wi and is scattered along −d: the same angle as from d to wi.
    f = phase(lobes, d, wi) * more_in_disc(column, r2, reach2) * abs(slant)
    if t > beam.sure:
        f *= _f4(math.exp((t - beam.sure) * beam.rate))
    T = through(scene, column, t)
    return True, (f * red * T[0], f * green * T[1], f * blue * T[2])


@device
def _slope(n, d):
    """How far along the ray a disc with normal n reaches, in radii."""
    c = dot(n, d)
    return _f4(math.sqrt(max(_f4(1.0) - c * c, _f4(0.0))))


@device
def beam_radiance(scene, grid, beam, radius, paths, column, lobes):
    """Radiance (red, green, blue) at its beginning that photons send back along a Beam through a medium of that column
    (`pmviewer.kernels.media.column`) and phase function `lobes`, and the number of photons that it is from. grid:
    record of a PhotonGrid; a radius above the grid's own is lowered to it; paths: the most it is on lattices, in free
    paths at a photon."""
    radius = min(radius, grid.radius)
    r2 = radius * radius
    before, behind = radius * _slope(beam.first, beam.d), radius * _slope(beam.last, beam.d)
    o, length = along(beam.o, beam.d, -before), before + beam.length + behind
    slabs = slabs_of(grid, o, beam.d, length, radius)
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
                    for block in range(first // WIDTH, (end - 1) // WIDTH + 1):
                        mask = beside8(grid.blocks + block * BLOCK_BYTES, beam.o, beam.d, r2)
                        mask &= lanes_between(first, end, block)
                        while mask != 0:
                            place = photon_place(grid, block * WIDTH + count_trailing_zeros(mask))
                            mask &= mask - _i4(1)
                            if hashed and not is_in_cell(grid, place[2], x, y, z):
                                continue
                            counts, L = _one(scene, place, beam, r2, paths, column, lobes)
                            if counts:
                                count += 1
                                red += _f8(L[0])
                                green += _f8(L[1])
                                blue += _f8(L[2])
    scale = _f8(grid.power_unit) / (_f8(math.pi) * _f8(r2))
    return (_f4(red * scale), _f4(green * scale), _f4(blue * scale)), count
