"""Volume elements: numbers in space, constant or on a lattice."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.scene.formats.mitsuba.document import Document, MissingFile, Properties
from pmviewer.scene.formats.mitsuba.transform import scaling, translation
from pmviewer.scene.formats.mitsuba.xml import Element
from pmviewer.scene.formats.volume_file import VolumeFile, read_volume
from pmviewer.scene.grid import Grid
from pmviewer.scene.medium import RGB

_LEFT_OUT = "Volumes that can't be used: {names}."
_FLATTEST = 1e-12
"""Least volume of a lattice's box over that of a cube of its longest edge."""


class Volume(NamedTuple):
    """A constant `factor`, and a grid that it multiplies; without one the constant's `box`, (4, 4): the unit cube."""

    factor: RGB
    grid: Grid | None = None
    box: NDArray[np.float64] = np.eye(4)

    @property
    def boxed(self) -> Grid:
        """The grid, or one of a single cell that is 1 in the box."""
        return self.grid or Grid(np.ones((1, 1, 1, 1), np.float32), self.box, "box")


class Volumes:
    """The volumes of a scene's media; every element and every file is read once."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self._of: dict[tuple[int, float | None], Volume | None] = {}
        self._files: dict[Path, VolumeFile | SceneError] = {}

    def has(self, p: Properties, name: str) -> bool:
        """Is there a volume or a value of that name?"""
        return name in p or any(at == name for at, _ in p.named_objects("volume"))

    def of(self, p: Properties, name: str, default: float, most: float | None) -> Volume | None:
        """A value or volume of that name, not above `most`; None, with a warning, for one that can't be used."""
        for at, element in p.named_objects("volume"):
            if at == name:
                key = (id(element), most)
                if key not in self._of:
                    self._of[key] = self._read(Properties(element, self.document, 1), name, default, most)
                return self._of[key]
        return Volume(p.bounded_colour(name, default, most))

    def _read(self, p: Properties, name: str, default: float, most: float | None) -> Volume | None:
        if p.type == "constvolume":
            value = p.bounded_colour("value", default, most)
            box = p.transform()
            p.warn_unused()
            if not _is_box(box):
                self.document.ignore(p.element, "has a flat box")
                return None
            return Volume(value, box=box)
        if p.type != "gridvolume":
            self.document.ignore(p.element, "is not supported")
            return None
        white = (1.0, 1.0, 1.0)
        try:
            return Volume(white, self._grid(p, name == "density", most))
        except SceneError as error:
            if isinstance(error, MissingFile):
                self.document.missing(error.name, p.element)
            else:
                shown = p.string("filename", "").replace("\\", "/")[-80:] or str(p.element)
                reason = f"{shown} ({error.what.rstrip('.')[:200]})"
                self.document.diagnostics.warn_of(reason, _LEFT_OUT, p.element.line, p.element.file)
            return None

    def _grid(self, p: Properties, by_file: bool, most: float | None) -> Grid:
        name = p.string("filename", "")
        to_world = p.transform()
        boxed = p.boolean("use_grid_bbox", by_file)  # version 0.6, which says "density", always did
        word = p.string("filter_type", "trilinear")
        if word not in ("trilinear", "bilinear"):
            self.document.warn(f"{p.element} is interpolated where the file asks for '{word[:40]}'.", p.element)
        word = p.string("wrap_mode", "clamp")
        if word != "clamp":
            self.document.warn(f"{p.element} is not repeated, as 'wrap_mode' asks for.", p.element)
        p.known("raw", "accel", "send_data")
        p.warn_unused()
        if not name:
            raise SceneError("it names no file")
        file = self._file(name, p.element)
        if boxed and file.box is not None:
            low, high = file.box
            size = (high[0] - low[0], high[1] - low[1], high[2] - low[2])
            to_world = to_world @ translation(*low) @ scaling(*size)
        if not _is_box(to_world):
            raise SceneError("its box is flat")
        values = file.values
        if file.mended:
            what = f"{name[-80:]} has {file.mended:,} numbers that are negative or not finite: they count as 0."
            self.document.warn(what, p.element)
        if most is not None and float(values.max()) > most:
            self.document.warn(f"{name[-80:]} has numbers above {most:g}: they were cut.", p.element)
            values = np.minimum(values, np.float32(most))
        return Grid(values, to_world, Path(name.replace("\\", "/")).name)

    def _file(self, name: str, element: Element) -> VolumeFile:
        path = self.document.file(name, element)
        if path not in self._files:
            try:
                self._files[path] = read_volume(path)
            except SceneError as error:
                self._files[path] = error
        found = self._files[path]
        if isinstance(found, SceneError):
            raise found
        return found


def _is_box(to_world: NDArray[np.float64]) -> bool:
    """Does it move the unit cube to a box with some volume?"""
    if not np.isfinite(to_world).all() or not np.array_equal(to_world[3], (0, 0, 0, 1)):
        return False
    longest = float(np.linalg.norm(to_world[:3, :3], axis=0).max())
    return longest > 0 and abs(float(np.linalg.det(to_world[:3, :3] / longest))) > _FLATTEST
