"""Meshes from loose triangles that arrive in pieces."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.meshes.mesh import renumber
from pmviewer.kernels.meshes.weld import EMPTY, rehash, weld
from pmviewer.progress import parallel
from pmviewer.scene.description import Mesh

FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
"""A triangle as binary STL files have it."""
_FULLEST = 0.6
"""Share of the table in use up to which collisions are rare."""
_LEAST = 8
"""Slots, of which three corners must find room."""
_AHEAD = 128
"""Triangles whose places in the table are fetched together."""
_AT_ONCE = 1 << 18
"""Triangles that one thread renumbers at a time."""
_JOINED_AT_ONCE = 2000
"""Triangles that the vertices of another part are added as: small enough to stay in the cache."""


class Welder:
    """Gathers up to `count` triangles and gives corners of the same float32 coordinates one vertex, in the order of
    their first appearance.

    Closed meshes have half as many vertices as triangles, and the table has room for those at first. It grows for
    others: loose triangles have three vertices each.
    """

    def __init__(self, count: int) -> None:
        self._index = np.empty(3 * count, np.int32)
        self._ahead = np.empty((2, 3 * _AHEAD), np.uint32)
        self._filled = self._used = 0
        self._allocate(max(1 << count.bit_length(), _LEAST))

    def _allocate(self, slots: int) -> None:
        self._table = np.full(slots, EMPTY, np.uint32)
        self._vertices = np.empty((int(_FULLEST * slots), 3), np.uint32)

    def add(self, facets: NDArray[np.void]) -> None:
        """Triangles (n,) as FACETs."""
        corners = facets["corners"].view(np.uint32)
        while len(corners):
            index = self._index[3 * self._filled :]
            done, self._used = weld(corners, self._table, self._vertices, self._used, index, self._ahead)
            self._filled += done
            corners = corners[done:]
            if len(corners):
                known = self._vertices[: self._used]
                self._allocate(2 * len(self._table))
                self._vertices[: len(known)] = known
                rehash(known, self._table)

    def join(self, other: Welder) -> None:
        """The other's triangles after the own: the same as if they had been added here."""
        known, first = other._vertices[: other._used], self._filled
        for start in range(0, len(known), 3 * _JOINED_AT_ONCE):
            piece = known[start : start + 3 * _JOINED_AT_ONCE]
            loose = np.empty(-(-len(piece) // 3), FACET)
            corners = np.repeat(known[:1], 3 * len(loose), axis=0)
            corners[: len(piece)] = piece
            loose["corners"] = corners.view(np.float32).reshape(-1, 3, 3)
            self.add(loose)
        number = self._index[3 * first :][: len(known)].copy()
        faces = other._index[: 3 * other._filled].reshape(-1, 3)
        self._filled = first + len(faces)
        own = self._index[3 * first : 3 * self._filled].reshape(-1, 3)
        pieces = [slice(i, i + _AT_ONCE) for i in range(0, len(faces), _AT_ONCE)]
        parallel([partial(renumber, faces[piece], number, own[piece]) for piece in pieces])

    def mesh(self) -> Mesh:
        """The triangles so far."""
        vertices = self._vertices[: self._used].view(np.float32)
        with np.errstate(invalid="ignore"):  # NaN, which is left out later
            return Mesh(vertices.astype(np.float64), self._index[: 3 * self._filled].reshape(-1, 3))
