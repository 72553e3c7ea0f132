"""Lattices in media as the arrays that kernels read (`pmviewer.kernels.media.lattice`)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.media.lattice import BLOCK, GRID_NUMBERS
from pmviewer.scene.grid import Grid
from pmviewer.scene.medium import Medium


def grids_of(medium: Medium) -> tuple[Grid | None, Grid | None, Grid | None]:
    """What a medium's factors multiply: extinction, albedo, emission."""
    return medium.density, medium.albedo_grid, medium.emission_grid


def has_grids(media: tuple[Medium, ...]) -> bool:
    """Do numbers of a medium vary in space?"""
    return any(grid is not None for medium in media for grid in grids_of(medium))


def numbers_of_grids(media: tuple[Medium, ...], more: Sequence[Grid] = ()) -> dict[int, int]:
    """Numbers of all grids by their id, those of media first. One that is there several times has one number."""
    found = dict.fromkeys(id(g) for medium in media for g in grids_of(medium) if g is not None)
    return {key: i for i, key in enumerate([*found, *(id(g) for g in more if id(g) not in found)])}


def grid_arrays(media: tuple[Medium, ...], more: Sequence[Grid] = ()) -> dict[str, NDArray]:
    """The fields of `pmviewer.kernels.scene.GRID_FIELDS`, with `more` grids behind those of the media; there may be
    none."""
    number = numbers_of_grids(media, more)
    found = {id(g): g for g in (*(g for medium in media for g in grids_of(medium) if g is not None), *more)}
    rows = [[-1 if g is None else number[id(g)] for g in grids_of(medium)] for medium in media]
    frames, sizes, voxels, blocks = [], [], [], []
    start = first_block = 0
    for grid in found.values():
        padded, most = _padded(grid.values), _blocks(grid.values)
        nz, ny, nx, channels = grid.values.shape
        frames.append(frame_of(grid)[:3].reshape(-1))
        sizes.append([nx, ny, nz, channels, start, first_block])
        voxels.append(padded.reshape(-1))
        blocks.append(most.reshape(-1))
        start += padded.size
        first_block += most.size
    return {
        "medium_grids": np.array(rows, np.int32).reshape(-1, GRID_NUMBERS),
        "grid_frames": np.array(frames, np.float64),
        "grid_sizes": np.array(sizes, np.int64),
        "voxels": np.concatenate([np.zeros(0, np.float32), *voxels]),
        "grid_blocks": np.concatenate([np.zeros(0, np.float32), *blocks]),
    }


def _padded(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """With the outermost numbers twice: (nz + 2, ny + 2, nx + 2, channels)."""
    return np.pad(values, ((1, 1), (1, 1), (1, 1), (0, 0)), mode="edge")


def _blocks(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Greatest number at the corners of the cells of each block, of all channels: what is interpolated in the block
    is never above it."""
    most = _padded(values).max(axis=3)
    for axis in range(3):
        corners = most.shape[axis]  # of one cell less
        starts = np.arange(0, corners - 1, BLOCK)
        shared = np.take(most, np.minimum(starts + BLOCK, corners - 1), axis=axis)
        cells = np.take(most, np.arange(corners - 1), axis=axis)
        most = np.maximum(np.maximum.reduceat(cells, starts, axis=axis), shared)
    return np.ascontiguousarray(most, np.float32)


def frame_of(grid: Grid) -> NDArray[np.float64]:
    """(4, 4): from world to lattice, number i of an axis at i + 1."""
    nz, ny, nx, _ = grid.values.shape
    to_lattice = np.diag([nx, ny, nz, 1.0])
    to_lattice[:3, 3] = 0.5
    return np.asarray(to_lattice @ np.linalg.inv(grid.to_world))
