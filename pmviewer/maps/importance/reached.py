"""How far importance has to be searched for: boxes that know the farthest reach of the importons that touch them.

In a box that no reach touches there is nothing to be searched for, and elsewhere no farther than those that do. Boxes
may say too much, never too little.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

BOXES = 1 << 17
"""About so many."""

Float = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class ReachedBoxes:
    """Boxes of `edge` from `low` (3,) on: `reached` (x, y, z) float32, the farthest reach that touches each, 0 where
    none does; outside of them none does."""

    low: NDArray[np.float64]
    edge: float
    reached: Float

    def at(self, positions: Float) -> Float:
        """(n,) for positions (n, 3): how far to search, 0 where no importon reaches."""
        shape = np.array(self.reached.shape)
        with np.errstate(invalid="ignore"):
            box = np.floor((positions - self.low) / self.edge)
        inside = ((box >= 0) & (box < shape)).all(axis=1)
        out = np.zeros(len(positions), np.float32)
        out[inside] = self.reached[tuple(box[inside].astype(np.int64).T)]
        return out


def reached_boxes(positions: Float, reach: Float, boxes: int = BOXES) -> ReachedBoxes:
    """Of importons at positions (n, 3) with `reach` (n,): about so many boxes."""
    if not len(positions):
        return ReachedBoxes(np.zeros(3), 1.0, np.zeros((0, 0, 0), np.float32))
    farthest = float(reach.max())
    low, high = (positions.min(axis=0) - farthest).astype(np.float64), (positions.max(axis=0) + farthest).astype(float)
    size = np.maximum(high - low, 1e-3 * float((high - low).max()) + 1e-30)
    edge = float(size.prod() / boxes) ** (1 / 3)
    shape = tuple(int(n) for n in np.floor(size / edge).astype(int) + 1)
    where = np.ravel_multi_index(tuple(np.floor((positions - low) / edge).astype(np.int64).T), shape)
    most = np.zeros(math.prod(shape), np.float32)
    np.maximum.at(most, where, reach)
    occupied = np.zeros(math.prod(shape), bool)
    occupied[where] = True
    # Boxes that reach about as far are widened together, by whole boxes and one for where in them places are.
    steps = np.ceil(most / edge).astype(int) + 1
    classes = 1 << np.ceil(np.log2(steps)).astype(int)
    reached = np.zeros(shape, np.float32)
    for width in np.unique(classes[occupied]):  # from short reaches to far ones
        alike = occupied & (classes == width)
        # A little farther than anything reaches, or rounding might decide.
        reached[_widened(alike.reshape(shape), int(width))] = np.float32(1.001) * most[alike].max()
    return ReachedBoxes(low, edge, reached)


def _widened(boxes: NDArray[np.bool_], width: int) -> NDArray[np.bool_]:
    """Boxes up to `width` away along each axis from one that is True."""
    for axis in range(3):
        n = boxes.shape[axis]
        sums = np.concatenate([np.zeros_like(boxes.take([0], axis), np.int64), boxes.cumsum(axis)], axis)
        first, end = np.maximum(np.arange(n) - width, 0), np.minimum(np.arange(n) + width + 1, n)
        boxes = sums.take(end, axis) > sums.take(first, axis)
    return boxes
