"""Radiance photons: places on surfaces where gather rays find the irradiance ready (R3; Christensen 1999, Pharr §0.3).

A share of the global photons become sites: position, normal of the surface on the side that the photon came from, and
the irradiance there from the whole map. A gather ray takes that of the nearest site on the same side with a similar
normal. What is stored is irradiance; the albedo is that of the surface which the ray hit, so edges between materials
stay sharp.

A site's irradiance is made when the first ray needs it. It depends on the site and the map alone, so that two threads
that make it at once store the same number, and no order of threads changes the picture.

Where no site is near enough, the ray looks the map up itself. That makes the mean exact: let photons be independent and
evenly dense, m of them expected in a look-up disc of radius r, a share s of them sites, and sites be used up to the
distance c ≤ r/2. The nearest site lies at a distance d with s·π·d²·density = t exponentially distributed. A look-up
around it counts the site itself, and misses the sites in the empty disc of radius d around the ray's end: 1 + m − t on
average. Beyond c, where t > T, the look-up around the ray's end misses T: m − T. Their mean is
∫₀ᵀ e⁻ᵗ(1 + m − t) dt + e⁻ᵀ(m − T) = m. Black beyond the cut-off would lack the second term, and c > r/2 counts too
many, by up to a tenth of m when few photons lie in a disc.

The grid is that of photons (`pmviewer.maps.search.grid`): word 3 holds the normal, words 4 and 5 of a block of eight
are eight 64-bit slots of irradiance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import (
    count_trailing_zeros,
    load_f4,
    load_shared_i8,
    load_u4,
    stack_get_f4,
    stack_get_i4,
    stack_i4,
    store_shared_i8,
)
from pmviewer.kernels.vector import normalize
from pmviewer.maps.photon_words import decode_direction, decode_power, encode_power
from pmviewer.maps.search.disc import Disc
from pmviewer.maps.search.grid import PhotonGrid, build_grid, counted_in_block, grid_ranges
from pmviewer.maps.search.simd import BLOCK_BYTES, ROW_BYTES, WIDTH

Share = Literal["all", "1/4", "1/8"]
SHARES: dict[Share, int] = {"all": 1, "1/4": 4, "1/8": 8}

HEADROOM = 2.0**15
"""Irradiances are stored in units of that of this many photons in a disc: 2⁻³² to 2³² photons' worth have codes."""

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32

UNKNOWN = _i8(0)
_KNOWN = _i8(1 << 48)


@dataclass(frozen=True, eq=False)
class RadianceMap:
    """`grid` holds the sites, its power unit is that of the irradiances. Kernels fill them in through `record`."""

    grid: PhotonGrid

    @property
    def n(self) -> int:
        """Places that can hold an irradiance, whether or not a ray has asked for it."""
        return self.grid.n

    @property
    def bytes(self) -> int:
        """Irradiances included: they lie in the grid's own rows."""
        return self.grid.bytes

    @property
    def record(self) -> NDArray[np.void]:
        """The grid's, for kernels; valid while this object lives."""
        return self.grid.record

    def known(self) -> NDArray[np.float32]:
        """Sites that rays have used, in the order of the grid, as photon records (n, 6) (`pmviewer.maps.record`): the
        normal as direction, the irradiance as power."""
        slots = np.ascontiguousarray(self.grid.blocks[:, 4:6]).reshape(-1, 2 * WIDTH).view(np.int64).reshape(-1)
        slots = slots[: self.n]
        used = slots != UNKNOWN
        sites = self.grid.photons[used]
        words = sites.view(np.uint32)
        words[:, 4] = slots[used] & 0xFFFFFFFF
        words[:, 5] = slots[used] >> 32 & 0xFFFF
        return sites


def chosen(n: int, share: Share) -> NDArray[np.bool_]:
    """Which of n photons become sites: a fixed hash of their place, independent of where they are."""
    if share == "all":
        return np.ones(n, bool)
    h = np.arange(n, dtype=np.uint32)
    for factor in (np.uint32(0x7FEB352D), np.uint32(0x846CA68B)):
        h ^= h >> np.uint32(16)
        h *= factor
    h ^= h >> np.uint32(15)
    return h % np.uint32(SHARES[share]) == 0


def build_sites(
    photons: NDArray[np.float32], normals: NDArray[np.uint32], share: Share, radius: float, unit: float
) -> RadianceMap:
    """Radiance photons among photons (n, 6) with normal codes (n,), not yet computed.

    radius: the largest distance at which a site is used; unit: irradiance of one photon in a disc.

    Raises SettingError when radius or unit is not positive and finite.
    """
    wanted = chosen(len(photons), share)
    sites = np.zeros((int(wanted.sum()), 6), np.float32)
    sites[:, :3] = photons[wanted, :3]
    sites.view(np.uint32)[:, 3] = normals[wanted]
    return RadianceMap(build_grid(sites, radius, unit * HEADROOM))


@device
def _column(sites, site):
    """Address of the x of a site, whose other words follow at multiples of ROW_BYTES."""
    return sites.blocks + (site // WIDTH) * BLOCK_BYTES + 4 * (site % WIDTH)


@device
def _slot(sites, site):
    return sites.blocks + (site // WIDTH) * BLOCK_BYTES + 4 * ROW_BYTES + 8 * (site % WIDTH)


@device
def site_place(sites, site):
    """Position and unit normal of a site."""
    at = _column(sites, site)
    x, y, z = load_f4(at, 0), load_f4(at, WIDTH), load_f4(at, 2 * WIDTH)
    return (x, y, z), normalize(decode_direction(load_u4(at, 3 * WIDTH)))


@device
def nearest_site(sites, p, n, radius, flatness, similarity):
    """The nearest site closer than `radius` to the point p with unit normal n, −1 if there is none.

    Its normal's cosine to n is at least `similarity` (> 0: sites of the surface's other side are not taken), and it
    lies within flatness·radius of the tangent plane.
    """
    radius = min(radius, sites.radius)
    r2 = radius * radius
    height = flatness * radius
    ranges, squared = stack_i4(16), stack_i4(8)
    best = _i8(-1)
    for k in range(grid_ranges(sites, p[0], p[1], p[2], radius, ranges)):
        first, end = _i8(stack_get_i4(ranges, 2 * k)), _i8(stack_get_i4(ranges, 2 * k + 1))
        for block in range(first // WIDTH, (end - 1) // WIDTH + 1):
            mask = counted_in_block(sites, block, first, end, Disc(p, n, r2, height, _i4(1)), squared)
            words = sites.blocks + block * BLOCK_BYTES + 3 * ROW_BYTES
            while mask != 0:
                lane = count_trailing_zeros(mask)
                mask &= mask - _i4(1)
                d2 = stack_get_f4(squared, lane)
                if d2 < r2:
                    m = normalize(decode_direction(load_u4(words, lane)))
                    if m[0] * n[0] + m[1] * n[1] + m[2] * n[2] >= similarity:
                        r2 = d2
                        best = block * WIDTH + lane
    return best


@device
def site_slot(sites, site):
    """The stored irradiance as a word for `site_irradiance`, or UNKNOWN."""
    return load_shared_i8(_slot(sites, site))


@device
def site_irradiance(sites, word):
    """(red, green, blue) in W per unit area."""
    unit = sites.power_unit
    return (
        decode_power(_u4(word & _i8(0xFFFF))) * unit,
        decode_power(_u4((word >> 16) & _i8(0xFFFF))) * unit,
        decode_power(_u4((word >> 32) & _i8(0xFFFF))) * unit,
    )


@device
def store_irradiance(sites, site, E):
    """Keep the irradiance of a site; returns its word."""
    scale = _f4(1.0) / sites.power_unit
    r, g, b = encode_power(E[0] * scale), encode_power(E[1] * scale), encode_power(E[2] * scale)
    word = _KNOWN | (_i8(b) << 32) | (_i8(g) << 16) | _i8(r)
    store_shared_i8(_slot(sites, site), word)
    return word
