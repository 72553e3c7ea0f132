"""Radiance photons: places on surfaces where gather rays find the irradiance ready (R3; Christensen 1999, Pharr §0.3).

A share of the global photons become radiance photons: position, normal of the surface on the side that the photon came
from, and the irradiance there from the whole map. A gather ray takes that of the nearest one on the same side with a
similar normal. What is stored is irradiance; the albedo is that of the surface which the ray hit, so edges between
materials stay sharp.

The irradiance is made when the first ray needs it. It depends on the radiance photon and the map alone, so that two
threads that make it at once store the same number, and no order of threads changes the picture.

Where none is near enough, the ray looks the map up itself. That makes the mean exact: let photons be independent and
evenly dense, m of them expected in a look-up disc of radius r, a share s of them radiance photons, which are used up to
the distance c ≤ r/2. The nearest lies at a distance d with s·π·d²·density = t exponentially distributed. A look-up
around it counts the photon itself, and misses those in the empty disc of radius d around the ray's end: 1 + m − t on
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
from pmviewer.kernels.vector import dot, normalize, sub
from pmviewer.maps.photon_words import decode_direction, decode_power, encode_power
from pmviewer.maps.search.grid import PhotonGrid, build_grid, grid_ranges, lanes_between
from pmviewer.maps.search.simd import BLOCK_BYTES, ROW_BYTES, WIDTH, within8

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
    """`grid` holds the radiance photons, with the unit of the irradiances. Kernels fill them in through `record`."""

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
        """Those that rays have used, in the order of the grid, as photon records (n, 6) (`pmviewer.maps.record`): the
        normal as direction, the irradiance as power."""
        slots = np.ascontiguousarray(self.grid.blocks[:, 4:6]).reshape(-1, 2 * WIDTH).view(np.int64).reshape(-1)
        slots = slots[: self.n]
        used = slots != UNKNOWN
        photons = self.grid.photons[used]
        words = photons.view(np.uint32)
        words[:, 4] = slots[used] & 0xFFFFFFFF
        words[:, 5] = slots[used] >> 32 & 0xFFFF
        return photons


def chosen(n: int, share: Share) -> NDArray[np.bool_]:
    """Which of n photons become radiance photons: a fixed hash of their place, independent of where they are."""
    if share == "all":
        return np.ones(n, bool)
    h = np.arange(n, dtype=np.uint32)
    for factor in (np.uint32(0x7FEB352D), np.uint32(0x846CA68B)):
        h ^= h >> np.uint32(16)
        h *= factor
    h ^= h >> np.uint32(15)
    return h % np.uint32(SHARES[share]) == 0


def build_radiance_map(
    photons: NDArray[np.float32], normals: NDArray[np.uint32], share: Share, radius: float, unit: float
) -> RadianceMap:
    """Radiance photons among photons (n, 6) with normal codes (n,), not yet computed.

    radius: the largest distance at which a radiance photon is used; unit: irradiance of one photon in a disc.

    Raises SettingError when radius or unit is not positive and finite.
    """
    wanted = chosen(len(photons), share)
    places = np.zeros((int(wanted.sum()), 6), np.float32)
    places[:, :3] = photons[wanted, :3]
    places.view(np.uint32)[:, 3] = normals[wanted]
    return RadianceMap(build_grid(places, radius, unit * HEADROOM))


@device
def _column(radiance, index):
    """Address of the x of a radiance photon, whose other words follow at multiples of ROW_BYTES."""
    return radiance.blocks + (index // WIDTH) * BLOCK_BYTES + 4 * (index % WIDTH)


@device
def _slot(radiance, index):
    return radiance.blocks + (index // WIDTH) * BLOCK_BYTES + 4 * ROW_BYTES + 8 * (index % WIDTH)


@device
def radiance_photon_place(radiance, index):
    """Position and unit normal of a radiance photon."""
    at = _column(radiance, index)
    x, y, z = load_f4(at, 0), load_f4(at, WIDTH), load_f4(at, 2 * WIDTH)
    return (x, y, z), normalize(decode_direction(load_u4(at, 3 * WIDTH)))


@device
def nearest_radiance_photon(radiance, p, n, radius, flatness, similarity):
    """The nearest radiance photon closer than `radius` to the point p with unit normal n, −1 if there is none.

    Its normal's cosine to n is at least `similarity` (> 0: those of the surface's other side are not taken), and it
    lies within flatness·radius of the tangent plane.
    """
    radius = min(radius, radiance.radius)
    r2 = radius * radius
    height = flatness * radius
    ranges, squared = stack_i4(16), stack_i4(8)
    best = _i8(-1)
    for k in range(grid_ranges(radiance, p[0], p[1], p[2], radius, ranges)):
        first, end = _i8(stack_get_i4(ranges, 2 * k)), _i8(stack_get_i4(ranges, 2 * k + 1))
        for block in range(first // WIDTH, (end - 1) // WIDTH + 1):
            at = radiance.blocks + block * BLOCK_BYTES
            mask = within8(at, at + ROW_BYTES, at + 2 * ROW_BYTES, p[0], p[1], p[2], r2, squared)
            mask &= lanes_between(first, end, block)
            while mask != 0:
                lane = count_trailing_zeros(mask)
                mask &= mask - _i4(1)
                d2 = stack_get_f4(squared, lane)
                if d2 < r2:
                    q, m = radiance_photon_place(radiance, block * WIDTH + lane)
                    if abs(dot(n, sub(q, p))) <= height and dot(m, n) >= similarity:
                        r2 = d2
                        best = block * WIDTH + lane
    return best


@device
def radiance_photon_slot(radiance, index):
    """The stored irradiance as a word for `radiance_photon_irradiance`, or UNKNOWN."""
    return load_shared_i8(_slot(radiance, index))


@device
def radiance_photon_irradiance(radiance, word):
    """(red, green, blue) in W per unit area."""
    unit = radiance.power_unit
    return (
        decode_power(_u4(word & _i8(0xFFFF))) * unit,
        decode_power(_u4((word >> 16) & _i8(0xFFFF))) * unit,
        decode_power(_u4((word >> 32) & _i8(0xFFFF))) * unit,
    )


@device
def store_irradiance(radiance, index, E):
    """Keep the irradiance of a radiance photon; returns its word."""
    scale = _f4(1.0) / radiance.power_unit
    r, g, b = encode_power(E[0] * scale), encode_power(E[1] * scale), encode_power(E[2] * scale)
    word = _KNOWN | (_i8(b) << 32) | (_i8(g) << 16) | _i8(r)
    store_shared_i8(_slot(radiance, index), word)
    return word
