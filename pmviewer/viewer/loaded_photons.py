"""Photons of a PLY file, to be drawn over the picture."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.viewer.background import READING, Background

_PLACE, _DIRECTION, _POWER = ("x", "y", "z"), ("nx", "ny", "nz"), ("power_r", "power_g", "power_b")


@dataclass(frozen=True, eq=False)
class FilePhotons:
    """Records (n, 6) as maps have them, their unit of power, and where they come from."""

    records: NDArray[np.float32]
    power_unit: float
    path: Path


class LoadedPhotons:
    """At most one file at a time."""

    def __init__(self, background: Background, shown: Callable[[], None]) -> None:
        """shown: called by `poll` when a file has been read."""
        self.photons: FilePhotons | None = None
        self._background = background
        self._shown = shown
        self._arrived: FilePhotons | None = None

    def open(self, path: Path) -> None:
        """Read the file beside the window."""

        def work() -> str:
            self._arrived = read_photons(path)
            return f"{len(self._arrived.records):,} photons of {path.name}"

        self._background.start(READING, "reading photons", work)

    def poll(self) -> None:
        """Once per window frame: take over what was read."""
        arrived, self._arrived = self._arrived, None
        if arrived is not None:
            self.photons = arrived
            self._shown()


def read_photons(path: Path) -> FilePhotons:
    """What `pmviewer photons` has written; of other points, those that are there of place, direction and power, with
    powers of 1 W. Raises SceneError."""
    from pmviewer.maps.pack import pack
    from pmviewer.output.ply import read_ply

    columns = read_ply(path)
    if not all(name in columns for name in _PLACE):
        raise SceneError("Its points have no place: x, y and z are missing.", path)
    n = len(columns["x"])

    def vectors(names: tuple[str, ...], otherwise: float) -> NDArray[np.float64]:
        if not all(name in columns for name in names):
            return np.full((n, 3), otherwise)
        return np.stack([columns[name] for name in names], axis=1).astype(np.float64)

    def numbers(name: str) -> NDArray[np.int64]:
        return np.nan_to_num(columns.get(name, np.zeros(n))).astype(np.int64)

    places = vectors(_PLACE, 0.0)
    good = np.isfinite(places).all(axis=1)
    wi, Phi = vectors(_DIRECTION, 0.0)[good], vectors(_POWER, 1.0)[good]
    bounces, path_class, light = (numbers(name)[good] for name in ("bounces", "path_class", "light"))
    records, unit = pack(places[good], wi, Phi, bounces, path_class, light)
    return FilePhotons(records, unit, path)
