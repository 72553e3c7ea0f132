"""Reading single photons of a tree inside kernels; `photons` is the record of a PhotonKdTree."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.memory import load_f4, load_u4
from pmviewer.kernels.vector import dot, sub
from pmviewer.maps.photon_words import decode_direction, decode_normal, decode_powers
from pmviewer.maps.search.sides import is_apart

ALL_CLASSES = 0b1111
"""Class mask that takes photons of every path class."""

_f4 = np.float32
_i4 = np.int32
_u4 = np.uint32


@specialised
def arrives(photons, i, p, n, class_mask):
    """Whether photon i counts at a place p: it comes from the side that the normal points to, on a path whose class has
    its bit set, and to a surface that may be the same (`pmviewer.maps.search.sides.is_apart`): what grazes the inside
    of a lamp's housing would else light its outside.

    Importons (`pmviewer.maps.importance`) have their surface's normal for a direction: it has to be similar.
    """
    if has(photons, "normals"):

        def similar(photons, i, p, n, class_mask):
            w = decode_direction(load_u4(photons.payload, 3 * i))
            cosine = dot(n, w)
            return cosine > _f4(0.0) and cosine * cosine > _f4(0.25) * dot(w, w)

        return similar

    def on_side(photons, i, p, n, class_mask):
        word = load_u4(photons.payload, 3 * i)
        if (class_mask >> _i4((word >> _u4(6)) & _u4(3))) & 1 == 0:
            return False
        if not dot(n, decode_direction(word)) > _f4(0.0):
            return False
        return not is_apart(decode_normal(word), sub(stored_place(photons, i), p), n)

    return on_side


@device
def stored_place(photons, i):
    """Where photon i is."""
    return load_f4(photons.x, i), load_f4(photons.y, i), load_f4(photons.z, i)


@device
def height_above(photons, i, p, n):
    """Signed distance of photon i from the plane through p with normal n."""
    return dot(n, sub(stored_place(photons, i), p))


@device
def stored_power(photons, i):
    """Red, green, blue power of photon i in units of the map's power."""
    return decode_powers(load_u4(photons.payload, 3 * i + 1), load_u4(photons.payload, 3 * i + 2))
