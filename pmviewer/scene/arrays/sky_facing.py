"""Tables of what an image environment's light counts on surfaces; see `pmviewer.kernels.lights.sky_facing`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.lights.sky_facing import FACINGS, FLOOR, SIDE, TABLE
from pmviewer.scene.arrays.sky_table import SkyTable

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
WITHIN = 4
"""Places per side of a cell of the square, and normals per side of a facing, that stand for them."""


def _middles(n: int) -> Float64:
    return (np.arange(n) + 0.5) / n


def _directions(table: SkyTable) -> Float32:
    """Unit directions in the image's frame, (SIDE² · WITHIN², 3), cell by cell; to a texel's width."""
    rows, width = len(table.rows), table.cells.shape[1]
    cell, within = np.divmod(np.arange(SIDE * SIDE * WITHIN * WITHIN), WITHIN * WITHIN)
    u = (cell // SIDE + _middles(WITHIN)[within // WITHIN]) / SIDE
    v = (cell % SIDE + _middles(WITHIN)[within % WITHIN]) / SIDE
    row = np.minimum(np.searchsorted(table.rows, u, side="right"), rows - 1)
    low = np.where(row > 0, table.rows[row - 1], 0.0)
    t = (u - low) / (table.rows[row] - low)
    place = np.empty(len(u))
    for i in np.unique(row):
        mine = row == i
        place[mine] = np.interp(v[mine], np.concatenate([[0.0], table.cells[i]]), np.arange(width + 1))
    theta, phi = (row + t) * (math.pi / rows), (place + 0.5) * (2 * math.pi / width)
    across = np.sin(theta)
    return np.stack([across * np.sin(phi), np.cos(theta), -across * np.cos(phi)], axis=1).astype(np.float32)


def _normals() -> Float32:
    """Unit normals (FACINGS² · WITHIN², 3) of the octahedral map, facing by facing."""
    facing, within = np.divmod(np.arange(FACINGS * FACINGS * WITHIN * WITHIN), WITHIN * WITHIN)
    x = 2 * (facing % FACINGS + _middles(WITHIN)[within % WITHIN]) / FACINGS - 1
    y = 2 * (facing // FACINGS + _middles(WITHIN)[within // WITHIN]) / FACINGS - 1
    z = 1 - abs(x) - abs(y)
    folded = z < 0
    x, y = (
        np.where(folded, np.copysign(1 - abs(y), x), x),
        np.where(folded, np.copysign(1 - abs(x), y), y),
    )
    n = np.stack([x, y, z], axis=1)
    return (n / np.linalg.norm(n, axis=1, keepdims=True)).astype(np.float32)


def facing_tables(table: SkyTable, to_world: Float64) -> Float32:
    """(FACINGS², TABLE) cumulative shares: of the rows of cells, then of the cells of each row."""
    directions, normals = _directions(table) @ to_world.astype(np.float32).T, _normals()
    cells = np.empty((FACINGS * FACINGS, SIDE * SIDE))
    for facing, own in enumerate(normals.reshape(len(cells), -1, 3)):
        seen = np.maximum(own @ directions.T, 0.0)
        cells[facing] = seen.mean(axis=0).reshape(SIDE * SIDE, -1).mean(axis=1)
    sums = cells.sum(axis=1, keepdims=True)
    share = np.where(sums > 0, cells / np.maximum(sums, 1e-30), 1 / SIDE**2)
    share = ((1 - FLOOR) * share + FLOOR / SIDE**2).reshape(-1, SIDE, SIDE)
    found = np.empty((len(share), TABLE), np.float32)
    rows = share.sum(axis=2)
    found[:, :SIDE] = np.cumsum(rows, axis=1)
    found[:, SIDE:] = (np.cumsum(share, axis=2) / rows[:, :, None]).reshape(len(share), -1)
    found[:, SIDE - 1 :: SIDE] = 1.0  # sums end there but for rounding, and searches must end
    return found
