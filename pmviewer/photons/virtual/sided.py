"""The photons that virtual lights are chosen from, with the normals of their surfaces (R10).

Which side a photon arrives on does not tell which surface it lies on: near an edge those of the other wall lie within
the flattened disc as well, and would be taken for a denser floor. So photons have their surface's normal for a
direction here, and look-ups ask for a similar one, as among importons (`pmviewer.maps.search.stored.arrives`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.surface import face
from pmviewer.maps.photon_words import encode_direction
from pmviewer.maps.search.kdtree import RECORD, PhotonKdTree, build_kdtree
from pmviewer.maps.variant import with_mark
from pmviewer.maps.virtual_lights import V_N, V_WI

SIDED_RECORD = with_mark(RECORD, "normals", [("arrivals", "i8")])
"""Of a kd-tree whose photons have their surface's normal for a direction; the words with their directions, uint32 (n,)
in the tree's order, are at the address `arrivals`."""


@dataclass(frozen=True, eq=False)
class SidedTree:
    """`record` for kernels, valid while this object lives; `tree` of the photons, and the words `arrivals`."""

    tree: PhotonKdTree
    arrivals: NDArray[np.uint32]
    record: NDArray[np.void]

    @property
    def n(self) -> int:
        """Of photons."""
        return self.tree.n

    @property
    def bytes(self) -> int:
        """Memory held, in bytes."""
        return self.tree.bytes + self.arrivals.nbytes


@kernel
def _turn(rows, index, payload, arrivals):
    """Puts normals on the photons' side into the payload of a tree, in place of the words with directions."""
    for i in range(len(index)):
        row = rows[index[i]]
        wi = row[V_WI], row[V_WI + 1], row[V_WI + 2]
        n = face((row[V_N], row[V_N + 1], row[V_N + 2]), wi)
        arrivals[i] = payload[i, 0]
        payload[i, 0] = encode_direction(n[0], n[1], n[2])


def sided_tree(photons: NDArray[np.float32], rows: NDArray[np.float32], power_unit: float) -> SidedTree:
    """Of photons (n, 6) and their rows (n, COLUMNS)."""
    tree = build_kdtree(photons, power_unit)
    arrivals = np.empty(tree.n, np.uint32)
    _turn(rows, tree.index, tree.payload, arrivals)
    record = np.zeros(1, SIDED_RECORD)
    for name in tree.record.dtype.names or ():
        record[name] = tree.record[name]
    record["normals"], record["arrivals"] = 1, arrivals.ctypes.data
    return SidedTree(tree, arrivals, record)
