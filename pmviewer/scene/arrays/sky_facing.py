"""Tables of what an image environment's light counts on surfaces; see `pmviewer.kernels.lights.sky_facing`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.lights.sky_facing import FACINGS, FLOOR
from pmviewer.kernels.lights.sky_square import SIDE, TABLE
from pmviewer.scene.arrays.sky_table import SkyTable

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
WITHIN = 4
"""Places per side of a cell of the square, and normals per side of a facing, that stand for them."""


def _middles(n: int) -> Float64:
    return (np.arange(n) + 0.5) / n


def sky_directions(shares_of_rows: Float32, shares_of_cells: Float32) -> Float32:
    """Unit directions in the image's frame, (SIDE² · WITHIN², 3), cell by cell; to a texel's width. Cumulative shares
    (h − 1,) and (h − 1, w) as of `SkyTable`."""
    rows, width = len(shares_of_rows), shares_of_cells.shape[1]
    cell, within = np.divmod(np.arange(SIDE * SIDE * WITHIN * WITHIN), WITHIN * WITHIN)
    u = (cell // SIDE + _middles(WITHIN)[within // WITHIN]) / SIDE
    v = (cell % SIDE + _middles(WITHIN)[within % WITHIN]) / SIDE
    row = np.minimum(np.searchsorted(shares_of_rows, u, side="right"), rows - 1)
    low = np.where(row > 0, shares_of_rows[row - 1], 0.0)
    t = (u - low) / (shares_of_rows[row] - low)
    place = np.empty(len(u))
    for i in np.unique(row):
        mine = row == i
        place[mine] = np.interp(v[mine], np.concatenate([[0.0], shares_of_cells[i]]), np.arange(width + 1))
    theta, phi = (row + t) * (math.pi / rows), (place + 0.5) * (2 * math.pi / width)
    across = np.sin(theta)
    return np.stack([across * np.sin(phi), np.cos(theta), -across * np.cos(phi)], axis=1).astype(np.float32)


def _normals(facings: int) -> Float32:
    """Unit normals (facings² · WITHIN², 3) of an octahedral map, facing by facing."""
    facing, within = np.divmod(np.arange(facings * facings * WITHIN * WITHIN), WITHIN * WITHIN)
    x = 2 * (facing % facings + _middles(WITHIN)[within % WITHIN]) / facings - 1
    y = 2 * (facing // facings + _middles(WITHIN)[within // WITHIN]) / facings - 1
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
    cosines = cosines_of(sky_directions(table.rows, table.cells) @ to_world.astype(np.float32).T, FACINGS)
    return cumulative((1 - FLOOR) * shares_of(cosines) + FLOOR / SIDE**2)


def cosines_of(directions: Float32, facings: int) -> Float64:
    """(facings², SIDE²): the mean of max(n·wi, 0) over a facing's normals and the directions (SIDE² · k, 3) of a
    cell."""
    cells = np.empty((facings * facings, SIDE * SIDE))
    for facing, own in enumerate(_normals(facings).reshape(len(cells), -1, 3)):
        seen = np.maximum(own @ directions.T, 0.0)
        cells[facing] = seen.mean(axis=0).reshape(SIDE * SIDE, -1).mean(axis=1)
    return cells


def shares_of(cells: NDArray[np.floating]) -> NDArray[np.floating]:
    """Of (…, SIDE²) the share of each in the last axis, the same for all where there is none."""
    sums = cells.sum(axis=-1, keepdims=True)
    shares = cells / np.maximum(sums, 1e-30)
    shares[sums[..., 0] <= 0] = 1 / SIDE**2
    return shares


def cumulative(shares: NDArray[np.floating]) -> Float32:
    """(n, TABLE) of shares (n, SIDE²), none of which is 0: cumulative, of the rows of cells, then of the cells of each
    row."""
    share = shares.reshape(-1, SIDE, SIDE)
    found = np.empty((len(share), TABLE), np.float32)
    rows = share.sum(axis=2)
    found[:, :SIDE] = np.cumsum(rows, axis=1)
    found[:, SIDE:] = (np.cumsum(share, axis=2) / rows[:, :, None]).reshape(len(share), -1)
    found[:, SIDE - 1 :: SIDE] = 1.0  # sums end there but for rounding, and searches must end
    return found
