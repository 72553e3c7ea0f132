"""Whether a light is visible from a place, as its shadow photons tell (T8; Jensen 1996 §4.1).

Of the photons of one light around a point, on the surface's side that they arrived on: all lit, then so is the point;
all in shadow, then so is the point; some of each, or fewer than asked for, then nobody knows and a ray has to tell.

The smallest of three discs decides that holds photons enough, radius r, r/2 and r/4: a light's photons lie dense in one
place and sparse in another, and the nearer they are, the fewer places are in doubt around the shadows' edges.

Penumbrae of area lights hold both kinds. A light of which the share s is hidden passes for visible with probability
(1 − s)ᵐ among m photons: what is lost are faint beginnings of penumbrae, and shadows smaller than the distance
between photons. That is the bias, and the number of photons asked for bounds it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import count_trailing_zeros, load_u4, stack_get_i4, stack_i4
from pmviewer.maps.radius import neighbourhood
from pmviewer.maps.record import HAD_DIFFUSE
from pmviewer.maps.search.disc import Disc
from pmviewer.maps.search.grid import PhotonGrid, build_grid, counted_in_block, grid_ranges
from pmviewer.maps.search.simd import BLOCK_BYTES, ROW_BYTES, WIDTH
from pmviewer.maps.search.stored import ALL_CLASSES
from pmviewer.maps.variant import marked

SHADOW_FLAGS = HAD_DIFFUSE | 1
"""Flags of a photon in shadow: of another class than direct ones, one surface behind."""

UNKNOWN, LIT, SHADOW = 0, 1, 2
DISCS = 3
FLATNESS = np.float32(0.2)
"""Half-thickness of the disc that is searched, relative to its radius."""

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32


def shadow_record(grid: PhotonGrid, fewest: int) -> NDArray[np.void]:
    """The grid's record (1,) for kernels, with the number of photons that it takes to decide."""
    return marked(grid.record, "fewest", fewest)


def build_shadows(photons: NDArray[np.float32], fewest: int, radius: float | None, scene_radius: float) -> PhotonGrid:
    """Shadow photons (n, 6) as a grid whose radius is that of the look-ups: `radius` or, if None, one within which
    photons enough lie nearly everywhere, and in half of it mostly too."""
    if radius is None:
        radius = neighbourhood(photons[:, :3], 6 * fewest)
    return build_grid(photons, min(max(radius, 1e-4 * scene_radius), scene_radius))


@device
def visibility(shadows, p, n, light):
    """LIT, SHADOW or UNKNOWN: the light as seen from the point p with unit normal n, on the normal's side.

    shadows: record of `shadow_record`.
    """
    ranges, squared = stack_i4(16), stack_i4(8)
    radius = _f4(0.25) * shadows.radius
    for _ in range(DISCS):
        disc = Disc(p, n, radius * radius, FLATNESS * radius, _i4(ALL_CLASSES))
        lit, dark = _i8(0), _i8(0)
        for k in range(grid_ranges(shadows, p[0], p[1], p[2], radius, ranges)):
            first, end = _i8(stack_get_i4(ranges, 2 * k)), _i8(stack_get_i4(ranges, 2 * k + 1))
            for block in range(first // WIDTH, (end - 1) // WIDTH + 1):
                mask = counted_in_block(shadows, block, first, end, disc, squared)
                words = shadows.blocks + block * BLOCK_BYTES + 3 * ROW_BYTES
                while mask != 0:
                    lane = count_trailing_zeros(mask)
                    mask &= mask - _i4(1)
                    if _i8(load_u4(words + 2 * ROW_BYTES, lane) >> _u4(16)) == light:
                        if load_u4(words, lane) & _u4(HAD_DIFFUSE) != 0:
                            dark += 1
                        else:
                            lit += 1
                        if lit > 0 and dark > 0:  # and so it is in every wider disc
                            return UNKNOWN
        if lit + dark >= shadows.fewest:
            return LIT if lit > 0 else SHADOW
        radius *= _f4(2.0)
    return UNKNOWN
