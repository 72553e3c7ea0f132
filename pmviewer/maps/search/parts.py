"""A photon map in several parts, each with a kd-tree of its own, as several workers make them (M4).

Each photon is in one part, and every part has nearly the same share of the trajectories, with powers in the units of
the whole. How look-ups combine what they find in each is in `pmviewer.maps.estimate.combined`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import load_f4, load_i8
from pmviewer.maps.search.kdtree import RECORD as TREE_RECORD
from pmviewer.maps.search.kdtree import PhotonKdTree

Combination = Literal["powers and areas", "irradiances"]
COMBINATIONS: tuple[Combination, ...] = ("powers and areas", "irradiances")
"""How look-ups in the parts are combined; a combination's number is its place here."""
POWERS_AND_AREAS, IRRADIANCES = range(len(COMBINATIONS))

RECORD = np.dtype(
    [("parts", np.int32), ("combine", np.int32), ("table", np.int64), ("power_unit", np.float32)], align=True
)
"""What kernels see: how many parts there are, how they are combined, and where the records of their trees stand."""

_WORDS8, _WORDS4 = TREE_RECORD.itemsize // 8, TREE_RECORD.itemsize // 4
_i8 = np.int64


class Part(NamedTuple):
    """The tree of one part in kernels: the fields of a tree's record that searches read."""

    x: Any
    y: Any
    z: Any
    payload: Any
    planes: Any
    n: Any
    depth: Any
    power_unit: Any
    smallest_radius: Any


@dataclass(frozen=True, eq=False)
class PhotonParts:
    """Photons in several trees; `table` (M,) are their records, `record` (1,) of RECORD is for kernels. Both are valid
    while this object lives."""

    trees: tuple[PhotonKdTree, ...]
    table: NDArray[np.void]
    record: NDArray[np.void]

    @property
    def n(self) -> int:
        """Of photons, in all parts."""
        return sum(tree.n for tree in self.trees)

    @property
    def bytes(self) -> int:
        """Memory held, in bytes, photons included."""
        return sum(tree.bytes for tree in self.trees) + self.table.nbytes

    def combined_by(self, combination: Combination) -> NDArray[np.void]:
        """The record (1,) for look-ups that combine the parts in this way. Valid while this object lives."""
        record = self.record.copy()
        record["combine"] = COMBINATIONS.index(combination)
        return record


def parts_of(trees: Sequence[PhotonKdTree]) -> PhotonParts:
    """A map of these trees, of which there is one at least, all in the same unit of power."""
    table = np.concatenate([tree.record for tree in trees])
    record = np.zeros(1, RECORD)
    record[0] = (len(trees), POWERS_AND_AREAS, table.ctypes.data, trees[0].power_unit)
    return PhotonParts(tuple(trees), table, record)


@device
def part_of(photons, m):
    """The `Part` of number m of the record of a PhotonParts."""
    at = _i8(m) * _i8(_WORDS8)
    floats = _i8(m) * _i8(_WORDS4)
    return Part(
        load_i8(photons.table, at),
        load_i8(photons.table, at + 1),
        load_i8(photons.table, at + 2),
        load_i8(photons.table, at + 3),
        load_i8(photons.table, at + 5),
        load_i8(photons.table, at + 6),
        load_i8(photons.table, at + 7),
        load_f4(photons.table, floats + 16),
        load_f4(photons.table, floats + 17),
    )
