"""Reading single photons of a tree inside kernels; `photons` is the record of a PhotonKdTree."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.memory import load_f4, load_u4
from pmviewer.maps.record import decode_direction, decode_power

ALL_CLASSES = 0b1111
"""Class mask that takes photons of every path class."""

_f4 = np.float32
_i4 = np.int32
_u4 = np.uint32


@specialised
def arrives(photons, i, nx, ny, nz, class_mask):
    """Whether photon i comes from the side that the normal points to, on a path whose class has its bit set.

    Importons (`pmviewer.maps.importance`) have their surface's normal for a direction: it has to be similar.
    """
    if has(photons, "importons"):

        def similar(photons, i, nx, ny, nz, class_mask):
            wx, wy, wz = decode_direction(load_u4(photons.payload, 3 * i))
            cosine = nx * wx + ny * wy + nz * wz
            return cosine > _f4(0.0) and cosine * cosine > _f4(0.25) * (wx * wx + wy * wy + wz * wz)

        return similar

    def on_side(photons, i, nx, ny, nz, class_mask):
        word = load_u4(photons.payload, 3 * i)
        if (class_mask >> _i4((word >> _u4(6)) & _u4(3))) & 1 == 0:
            return False
        wx, wy, wz = decode_direction(word)
        return nx * wx + ny * wy + nz * wz > _f4(0.0)

    return on_side


@device
def height_above(photons, i, px, py, pz, nx, ny, nz):
    """Signed distance of photon i from the plane through p with normal n."""
    dx, dy, dz = load_f4(photons.x, i) - px, load_f4(photons.y, i) - py, load_f4(photons.z, i) - pz
    return nx * dx + ny * dy + nz * dz


@device
def stored_power(photons, i):
    """Red, green, blue power of photon i in units of the map's power."""
    rg, b = load_u4(photons.payload, 3 * i + 1), load_u4(photons.payload, 3 * i + 2)
    return decode_power(rg & _u4(0xFFFF)), decode_power(rg >> _u4(16)), decode_power(b & _u4(0xFFFF))
