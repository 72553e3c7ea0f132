"""The photon as it is stored: 24 bytes (T4). Everything that has photons has them so: the light pass's buffers, maps
before they are built, samples, paths, clouds for the window and for files. Kernels write and read it with
`pmviewer.maps.photon_words`.

A map is a C-contiguous (n, 6) float32 array of which only the first three columns are floats; the rest is read
through its uint32 view:

====  =========================================================================================
0–2   position x, y, z (float32, scene units)
3     incident direction `wi`, octahedral, 12 + 12 bits, in the high 24 bits, of which the three lowest of either
      twelve tell the surface's normal; flags in the low 8
4     power red in the low, green in the high 16 bits
5     power blue in the low 16 bits, light id in the high 16 bits
====  =========================================================================================

`wi` points from the surface to where the photon came from. Powers are unsigned 16-bit floats (6 bits of exponent, 10
of mantissa: relative error 2⁻¹¹) in units of the map's `power_unit`; 1.0 is the power with which photons leave the
lights, so that the range 2⁻⁴⁷ … 2¹⁷ fits any scene's scale.

The normal is that of the side that the photon came to, octahedral, too, by one of 8 × 8 cells: no normal is farther
from its cell's middle than 30°. `wi` has the nearest code with these bits, 0.2° off and half a degree at worst.
Look-ups leave out photons of what is surely another side or surface (`pmviewer.maps.search.sides.is_apart`). Photons
of media have no normal, and all bits for `wi`, 0.06° off at worst.

Flags: bit 7 the last scattering was specular; bit 6 there was a non-specular scattering before. They spell the path
class: direct `LD` (neither bit), caustic `LS+D` (bit 7 alone), indirect (bit 6 alone), indirect caustic (both). Bit 5:
the photon came over mirrors and clear glass alone from a light that no ray can meet to a lobe that is followed, so that
no path from the eye finds this light. Bits 0–4: the number of scatterings so far (31 means 31 or more).

In scenes with dispersive glass the two lowest bits of each channel's power tell the photon's band of wavelengths, which
costs no power in the mean: the rest is rounded at random. Band 0 is that of photons that have all wavelengths still, 1
to BANDS those of the spectrum (`pmviewer.kernels.bsdf.kinds`). Rules that write powers anew lose it
(`pmviewer.maps.power`).

Rows rather than a structured type: three columns are coordinates as arrays of points are, one copy moves a photon, and
kernels address a word by its column. Grids and kd-trees keep the same words in an order of their own.
"""

from __future__ import annotations

import numpy as np

BYTES_PER_PHOTON = 24

LAST_SPECULAR = 0x80
HAD_DIFFUSE = 0x40
UNFOUND = 0x20
BOUNCES = 0x1F

DIRECT, CAUSTIC, INDIRECT, INDIRECT_CAUSTIC = 0, 2, 1, 3
"""Path classes as `flags >> 6`."""
ALL_CLASSES = 0b1111
"""Mask with the bits of all path classes."""

EXPONENT_BASE = (127 - 47) << 23
"""Bits of 2⁻⁴⁷ as float32, the power of code 0 if that did not mean none."""

_EXPONENT_BASE = np.uint32(EXPONENT_BASE)


def decode_directions(codes: np.ndarray) -> np.ndarray:
    """Codes (n,) uint32 → unit vectors (n, 3) float32."""
    u = ((codes >> 20).astype(np.float32) - 2047) / 2047
    v = (((codes >> 8) & 0xFFF).astype(np.float32) - 2047) / 2047
    return _unfolded(u, v)


def _unfolded(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Places (n,) on the octahedron's square → unit vectors (n, 3) float32."""
    z = 1 - np.abs(u) - np.abs(v)
    t = np.maximum(-z, 0)
    w = np.stack([u - np.where(u >= 0, t, -t), v - np.where(v >= 0, t, -t), z], axis=1)
    return np.ascontiguousarray(w / np.linalg.norm(w, axis=1, keepdims=True), np.float32)


def decode_normals(codes: np.ndarray) -> np.ndarray:
    """Codes (n,) uint32 of photons → middles (n, 3) float32 of the cells that their surfaces' normals are in, unit."""
    cells = np.stack([codes >> 20 & 7, codes >> 8 & 7], axis=1).astype(np.float32)
    return _unfolded(*((cells - 3.5) / 4).T)


def in_classes(photons: np.ndarray, mask: int) -> np.ndarray | None:
    """Which of photons (n, 6) are on a path whose class has its bit in the mask, (n,) bool; None where all are."""
    if mask == ALL_CLASSES or not len(photons):
        return None
    classes = (photons.view(np.uint32)[:, 3] >> 6) & 3
    wanted = np.array([mask >> c & 1 for c in range(4)], bool)[classes]
    return None if wanted.all() else wanted


def bands(photons: np.ndarray) -> np.ndarray:
    """Bands (n,) of wavelengths of photons (n, 6) of scenes with dispersive glass, 0 for all wavelengths."""
    words = np.ascontiguousarray(photons).view(np.uint32)
    red_green, blue = words[:, 4], words[:, 5]
    return ((red_green & 3) | ((red_green >> 16 & 3) << 2) | ((blue & 3) << 4)).astype(np.int32)


def unpack(photons, power_unit: float) -> dict[str, np.ndarray]:
    """Photons (n, 6) as named arrays: `position` (n, 3) float32, `wi` (n, 3) float32 unit, `Phi` (n, 3) float32 watts,
    `bounces` (n,) int, `path_class` (n,) int, `light` (n,) int."""
    words = photons.view(np.uint32)
    codes = np.stack([words[:, 4] & 0xFFFF, words[:, 4] >> 16, words[:, 5] & 0xFFFF], axis=1).astype(np.uint32)
    power = np.where(codes == 0, np.float32(0), ((codes << 13) + _EXPONENT_BASE).view(np.float32))
    flags = (words[:, 3] & 0xFF).astype(np.int32)
    return {
        "position": photons[:, :3],
        "wi": decode_directions(words[:, 3]),
        "Phi": (power * np.float32(power_unit)).astype(np.float32),
        "bounces": flags & BOUNCES,
        "path_class": flags >> 6,
        "light": (words[:, 5] >> 16).astype(np.int32),
    }
