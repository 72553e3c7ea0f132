"""What a look-up in a photon map asks for, as named tuples that kernels pass on."""

from __future__ import annotations

from typing import Any, NamedTuple


class Place(NamedTuple):
    """A place on a surface and the photons that count there.

    p, n: float32 triples, the point and the unit normal on the side that is asked about; flatness: float32,
    half-thickness of the disc relative to its radius, 1 for the full sphere; class_mask: int32 with bit `1 << class`
    set for each path class that counts.
    """

    p: Any
    n: Any
    flatness: Any
    class_mask: Any


class Disc(NamedTuple):
    """The flattened disc of a look-up of fixed radius: photons closer than √r2 to p and within `height` of the plane
    with normal n that arrive on n's side, of the classes in class_mask. As in `Place`; r2, height: float32."""

    p: Any
    n: Any
    r2: Any
    height: Any
    class_mask: Any


class Facing(NamedTuple):
    """The same for the k nearest: photons that arrive on the side of the unit normal n, of the classes in class_mask,
    with the distance max(d², steepness·h²), h being the height above the tangent plane. The k nearest then fill the
    smallest flattened disc |h| ≤ r/√steepness."""

    n: Any
    steepness: Any
    class_mask: Any
