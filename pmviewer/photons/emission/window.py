"""Splitting (I6): a photon that comes to a more important place than it was sent for goes on as several.

Photons that leave a stratum of importance I have the power κ/√I (`pmviewer.photons.emission.guided`). One that arrives
where photons that go on have the importance J ought to have κ/√J; with m times that it goes on as ⌊m + ½⌋ pieces of
equal power, as particles do in the weight windows of neutron transport. It is stored once, whole, where it arrives; the
pieces scatter each by themselves. Nothing is biased: how many there are depends on what was before alone.

J is known on a grid of boxes, for each of six directions of normals: what is on the other side of a wall is another
box's. It decides how many pieces there are and never what they count, so that boxes may be coarse.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.memory import load_f4

WINDOW_FIELDS: list[tuple[str, Any]] = [
    ("window", "i8"),  # float32 (x, y, z, 6) of boxes: √J
    ("low_x", "f4"),
    ("low_y", "f4"),
    ("low_z", "f4"),
    ("boxes_per_length", "f4"),
    ("boxes_x", "i4"),
    ("boxes_y", "i4"),
    ("boxes_z", "i4"),
    ("pieces_of", "f4"),  # 1/κ; 0: no photon is split
]
MOST_PIECES = 16
"""Of one trajectory."""
MOST_AT_ONCE = 8
"""Of one photon where it arrives."""
BOXES = 1 << 15
"""Boxes of the grid, about."""

Float = NDArray[np.float32]

_f4 = np.float32
_i8 = np.int64


@dataclass(frozen=True, eq=False)
class Window:
    """√J in boxes: `values` (x, y, z, 6) float32, from `low` (3,) on, `per_length` of them a unit of length."""

    values: Float
    low: Float
    per_length: float

    @property
    def bytes(self) -> int:
        """Of the boxes."""
        return self.values.nbytes


def window_of(positions: Float, normals: Float, importance: Float) -> Window:
    """From the importance (n,) at positions (n, 3) with unit normals (n, 3): the mean of each box."""
    low, high = positions.min(axis=0), positions.max(axis=0)
    size = np.maximum(high - low, 1e-3 * (high - low).max(initial=1e-30)).astype(np.float64)
    edge = max(float(size.prod() / BOXES) ** (1 / 3), float(size.max()) / 512)
    shape = tuple(int(s) for s in np.floor(size / edge).astype(int) + 1)
    box = np.minimum(((positions - low) / edge).astype(np.int64), np.array(shape) - 1)
    axis = np.abs(normals).argmax(axis=1)
    face = 2 * axis + (np.take_along_axis(normals, axis[:, None], 1)[:, 0] < 0)
    where = np.ravel_multi_index((*box.T, face), (*shape, 6))
    number = np.bincount(where, minlength=6 * int(np.prod(shape)))
    total = np.bincount(where, importance, minlength=len(number))
    values = np.sqrt(total / np.maximum(number, 1)).astype(np.float32).reshape(*shape, 6)
    return Window(values, low.astype(np.float32), 1.0 / edge)


def fill_window(records: NDArray[np.void], window: Window | None, pieces_of: float) -> None:
    """Write the fields of WINDOW_FIELDS; the window must live as long as the records."""
    if window is None:
        return
    records["window"], records["boxes_per_length"] = window.values.ctypes.data, window.per_length
    for axis, name in enumerate("xyz"):
        records[f"low_{name}"], records[f"boxes_{name}"] = window.low[axis], window.values.shape[axis]
    records["pieces_of"] = pieces_of


@specialised
def pieces(strata, p, ng, factor, number):
    """As how many pieces (int64) a photon of power `factor`, in units of the map's, goes on from p, on the side of ng;
    `number` is how many its trajectory has been split into before."""
    if not has(strata, "pieces_of"):
        return lambda strata, p, ng, factor, number: _i8(1)

    def by_importance(strata, p, ng, factor, number):
        if not strata.pieces_of > _f4(0.0):
            return _i8(1)
        x = (p[0] - strata.low_x) * strata.boxes_per_length
        y = (p[1] - strata.low_y) * strata.boxes_per_length
        z = (p[2] - strata.low_z) * strata.boxes_per_length
        # Up to a box's width beyond the first and the last one, or rounding would matter.
        inside = x > _f4(-1.0) and y > _f4(-1.0) and z > _f4(-1.0)
        if not (inside and x <= _f4(strata.boxes_x) and y <= _f4(strata.boxes_y) and z <= _f4(strata.boxes_z)):
            return _i8(1)
        i = min(_i8(max(x, _f4(0.0))), _i8(strata.boxes_x) - 1)
        j = min(_i8(max(y, _f4(0.0))), _i8(strata.boxes_y) - 1)
        k = min(_i8(max(z, _f4(0.0))), _i8(strata.boxes_z) - 1)
        a, b, c = abs(ng[0]), abs(ng[1]), abs(ng[2])
        face, along = (_i8(0), ng[0]) if a >= b and a >= c else (_i8(2), ng[1]) if b >= c else (_i8(4), ng[2])
        if along < _f4(0.0):
            face += _i8(1)
        at = ((i * _i8(strata.boxes_y) + j) * _i8(strata.boxes_z) + k) * _i8(6) + face
        m = factor * strata.pieces_of * load_f4(strata.window, at)
        return max(min(_i8(m + _f4(0.5)), _i8(MOST_AT_ONCE), _i8(MOST_PIECES) - number), _i8(1))

    return by_importance


@specialised
def most_pieces(strata):
    """As how many photons one trajectory may end (int64)."""
    if not has(strata, "pieces_of"):
        return lambda strata: _i8(1)
    return lambda strata: _i8(MOST_PIECES) if strata.pieces_of > _f4(0.0) else _i8(1)
