"""Media that emit, as lights: the lattices by which their photons and light samples find places in them
(`pmviewer.kernels.media.glow`)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.media.glow import (
    GL_AROUND,
    GL_GRID,
    GL_MASS,
    GL_MEDIUM,
    GL_NX,
    GL_POWER,
    GL_START,
    GL_TO_LATTICE,
    GL_TO_WORLD,
    GLOW_COLUMNS,
)
from pmviewer.scene.arrays.grids import frame_of
from pmviewer.scene.arrays.shape_bounds import shape_bounds
from pmviewer.scene.description import LUMINANCE, Scene
from pmviewer.scene.grid import Grid
from pmviewer.scene.medium import Medium

Float = NDArray[np.float64]
_FINER = 3
"""Places along an axis by which a number of a lattice is known whose emission has another lattice."""
_MOST_NUMBERS = 128
"""Along an axis of such a lattice."""
PHOTONS = 4096
"""Of a glow that tell how much of its box the medium fills."""
LEAST_SHARE = 1 / PHOTONS


@dataclass(frozen=True, eq=False)
class Glow:
    """What the medium number `medium` emits. `density` is the lattice of q, of one channel, and `power` (3,) float64
    the watts that its whole box would send out. `whole`: q is 1 everywhere; `around`: the medium fills all that no
    boundary tells of."""

    name: str
    medium: int
    density: Grid
    power: Float
    whole: bool
    around: bool

    @property
    def center(self) -> Float:
        """Mean place (3,) of what is emitted."""
        q = self.density.values[..., 0].astype(np.float64)
        total = max(float(q.sum()), 1e-300)
        inside = [
            float((q.sum(axis=tuple(k for k in range(3) if k != axis)) * _middles(q.shape[axis])).sum()) / total
            for axis in (2, 1, 0)
        ]
        return np.asarray((self.density.to_world @ [*inside, 1.0])[:3])


def _middles(n: int) -> Float:
    return (np.arange(n) + 0.5) / n


def glows_of(scene: Scene) -> tuple[Glow, ...]:
    """One of each medium that emits and is somewhere."""
    found = []
    for number, medium in enumerate(scene.media):
        if max(medium.emission) > 0 and (box := _box(scene, number, medium)) is not None:
            density, power, whole = _density(medium, box)
            if power.max() > 0:
                around = scene.camera.medium == number
                found.append(Glow(medium.name, number, density, power, whole, around))
    return tuple(found)


def _box(scene: Scene, number: int, medium: Medium) -> Float | None:
    """(4, 4): the unit cube to where the medium may be; None where nothing bounds it."""
    around = any(camera.medium == number for camera in (scene.camera, *(c.camera for c in scene.cameras)))
    bounding = [s for s in scene.all_shapes if s.media is not None and number in s.media]
    if not bounding and not around:
        return None
    if medium.density is not None:
        return medium.density.to_world
    own = {id(s) for s in scene.shapes}
    enclosed = not around and all(id(s) in own and s.media is not None and s.media[0] == number for s in bounding)
    corners = np.array([shape_bounds(s) for s in (bounding if enclosed else scene.shapes)])
    if not len(corners):
        return None
    low, high = corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)
    box = np.diag([*np.maximum(high - low, 1e-30), 1.0])
    box[:3, 3] = low
    return box


def _density(medium: Medium, box: Float) -> tuple[Grid, Float, bool]:
    """q on the box, the power of all of it, and whether q is 1 everywhere."""
    volume, factor = abs(float(np.linalg.det(box[:3, :3]))), np.array(medium.emission, np.float64)
    grid = medium.emission_grid
    if grid is None:
        return Grid(np.ones((1, 1, 1, 1), np.float32), box), 4 * math.pi * volume * factor, True
    if np.allclose(grid.to_world, box, rtol=1e-6, atol=1e-9 * float(np.abs(box).max())):
        values = grid.values
        power = 4 * math.pi * volume * factor * values.mean(axis=(0, 1, 2), dtype=np.float64)
        if values.shape[3] == 1:
            return grid, power, False
        weights = factor * LUMINANCE / max(float(factor @ LUMINANCE), 1e-300)
        return Grid((values @ weights)[..., None].astype(np.float32), box, grid.name), power, False
    values, means = _resampled(grid, box)
    power = 4 * math.pi * volume * factor * means
    return Grid(values, box, grid.name), power, False


def _resampled(grid: Grid, box: Float) -> tuple[NDArray[np.float32], Float]:
    """The grid's largest values around each number of a lattice on the box that is as fine, and its mean a channel."""
    from scipy.ndimage import map_coordinates  # not for scenes that are opened every day

    size = np.array(grid.values.shape[2::-1])
    to_grid = np.diag([*size, 1.0]) @ np.linalg.inv(grid.to_world) @ box
    numbers = np.ceil(np.abs(to_grid[:3, :3]).max(axis=0)).astype(int)[::-1]
    n = np.clip(numbers, 1, _MOST_NUMBERS)
    fine = _FINER * n
    most, total = np.zeros(tuple(fine), np.float32), np.zeros(grid.values.shape[3])
    y, x = np.meshgrid(_middles(fine[1]), _middles(fine[2]), indexing="ij")
    for k, z in enumerate(_middles(fine[0])):
        places = np.stack([x, y, np.full_like(x, z), np.ones_like(x)], axis=-1) @ to_grid.T
        at = [places[..., axis] - 0.5 for axis in (2, 1, 0)]
        for channel in range(len(total)):
            values = map_coordinates(grid.values[..., channel], at, order=1, mode="nearest")
            most[k] = np.maximum(most[k], values)
            total[channel] += values.sum(dtype=np.float64)
    blocks = most.reshape(n[0], _FINER, n[1], _FINER, n[2], _FINER).max(axis=(1, 3, 5))
    around = np.pad(blocks, 1, mode="edge")
    widest = np.lib.stride_tricks.sliding_window_view(around, (3, 3, 3)).max(axis=(3, 4, 5))
    return np.ascontiguousarray(widest[..., None], np.float32), np.broadcast_to(total / most.size, 3)


def glow_arrays(glows: tuple[Glow, ...], grids: dict[int, int]) -> dict[str, NDArray]:
    """The fields `glows` and `glow_cdf` of the record; `grids`: numbers of the scene's lattices by the id of theirs."""
    rows = np.zeros((len(glows), GLOW_COLUMNS))
    cdfs: list[Float] = []
    start = 0
    for row, glow in zip(rows, glows):
        q, to_world = glow.density.values, glow.density.to_world
        nz, ny, nx, _ = q.shape
        frame = frame_of(glow.density)
        row[GL_MEDIUM], row[GL_AROUND], row[GL_START] = glow.medium, glow.around, start
        row[GL_GRID] = -1 if glow.whole else grids[id(glow.density)]
        row[GL_NX : GL_NX + 3] = nx, ny, nz
        row[GL_MASS] = abs(np.linalg.det(to_world[:3, :3])) * q.mean(dtype=np.float64)
        row[GL_POWER] = glow.power @ LUMINANCE
        row[GL_TO_LATTICE : GL_TO_LATTICE + 12] = frame[:3].reshape(-1)
        row[GL_TO_WORLD : GL_TO_WORLD + 12] = np.linalg.inv(frame)[:3].reshape(-1)
        sums = np.cumsum(q.reshape(-1), dtype=np.float64)
        cdfs.append(sums / sums[-1])
        start += q.size
    return {"glows": rows, "glow_cdf": np.concatenate([*cdfs, np.zeros(1)])}


def weaken(rows: Float, shares: Float) -> None:
    """Write into the rows that the media fill these shares (n,) of what their boxes emit. Where no photon found the
    medium it is small, and not nothing."""
    np.maximum(shares, LEAST_SHARE, out=shares)
    rows[:, GL_POWER] *= shares
