"""Projectors in NumPy: their power, what they send where, and the numbers that kernels read.

The formulas are in `pmviewer.kernels.lights.projector`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.description import LUMINANCE, ProjectorLight

Float = NDArray[np.float64]


def _of_cells(light: ProjectorLight, values: Float) -> Float:
    """∫ over each cell on the plane at distance 1, (h − 1, w − 1, …), of values (h, w, …) at its corners."""
    means = (values[:-1, :-1] + values[1:, :-1] + values[:-1, 1:] + values[1:, 1:]) / 4
    areas = np.outer(np.diff(light.rows), np.diff(light.columns)) * (4 * light.half[0] * light.half[1])
    return np.asarray(means * areas.reshape(areas.shape + (1,) * (values.ndim - 2)))


def projector_power(light: ProjectorLight) -> Float:
    """∫ of the irradiance on the plane at distance 1, (3,) watts."""
    return np.asarray(_of_cells(light, light.pixels.astype(np.float64)).sum(axis=(0, 1)))


def brightest_intensity(light: ProjectorLight) -> float:
    """A bound on the intensity of any channel in any direction, in W/sr."""
    return float(light.pixels.max(initial=0.0)) * (1 + light.half[0] ** 2 + light.half[1] ** 2) ** 1.5


def intensity_towards(light: ProjectorLight, d: Float) -> Float:
    """Intensity (n, 3) in W/sr in the unit directions (n, 3) that leave it."""
    x, y, z = (d @ light.to_world).T
    ahead = np.maximum(z, 1e-300)
    u, v = 0.5 - 0.5 * x / (ahead * light.half[0]), 0.5 - 0.5 * y / (ahead * light.half[1])
    inside = (z > 0) & (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)
    found = np.zeros((len(d), 3))
    i, s = _cell(light.columns, u[inside])
    j, t = _cell(light.rows, v[inside])
    E = light.pixels.astype(np.float64)
    upper = (1 - s) * E[j, i] + s * E[j, i + 1]
    lower = (1 - s) * E[j + 1, i] + s * E[j + 1, i + 1]
    found[inside] = ((1 - t) * upper + t * lower) / z[inside, None] ** 3
    return found


def _cell(lines: Float, places: Float) -> tuple[NDArray[np.intp], Float]:
    """The cells between `lines` that places lie in, and the shares (n, 1) of their widths before these."""
    cell = np.clip(np.searchsorted(lines, places, side="right") - 1, 0, len(lines) - 2)
    wide = lines[cell + 1] - lines[cell]
    return cell, ((places - lines[cell]) / np.where(wide > 0, wide, 1.0))[:, None]


def projector_arrays(lights: Sequence[ProjectorLight]) -> dict[str, NDArray]:
    """The arrays of all projectors by the record's field; none without any."""
    if not lights:
        return {}
    numbers = [_numbers(light) for light in lights]
    firsts = np.cumsum([0, *(len(n) for n in numbers[:-1])])
    rows = [(first, len(light.columns), len(light.rows)) for first, light in zip(firsts, lights, strict=True)]
    return {"projectors": np.array(rows, np.int64), "projector_numbers": np.concatenate(numbers)}


def _numbers(light: ProjectorLight) -> NDArray[np.float32]:
    """Columns, rows, picture and tables in the order in which kernels look for them."""
    cells = np.cumsum(_of_cells(light, light.pixels.astype(np.float64) @ LUMINANCE), axis=1)
    sums = cells[:, -1]
    rows = np.cumsum(sums)
    # What is black is never picked; any table will do.
    shares = cells / np.where(sums > 0, sums, 1.0)[:, None]
    parts = (light.columns, light.rows, light.pixels, rows / (rows[-1] if rows[-1] > 0 else 1.0), shares)
    return np.concatenate([np.asarray(part, np.float32).ravel() for part in parts])
