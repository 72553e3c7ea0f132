"""Cells of a photon map as boxes: nodes of its kd-tree, or cells of its grid that hold photons, or blocks of those."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from pmviewer.output.false_look import look_of
from pmviewer.settings.access import CellOverlay, Settings
from pmviewer.viewer.format import grouped
from pmviewer.viewer.gl.lines import LineCloud
from pmviewer.viewer.gl.palette import By, Colouring
from pmviewer.viewer.gl.program import Drawing, Shaders
from pmviewer.viewer.gl.records import encoded
from pmviewer.viewer.overlays.legend import colour_bar, nothing_to_draw, wrapped
from pmviewer.viewer.overlays.overlay import Needs, Overlay, Source, Switch

if TYPE_CHECKING:
    from pmviewer.maps.search.cells import MapCells

UNIT = 1024.0
"""Photons a unit of the stored power, whose codes end at 2¹⁷."""
PHOTONS = Colouring(By.QUANTITY, 0, scale="range", text="Photons in a box")
LEVELS = Colouring(By.QUANTITY, 1, scale="range", text="Level in the tree, from the root")
_CORNERS = np.array([(i & 1, i >> 1 & 1, i >> 2) for i in range(8)])
_EDGES = np.array([(i, i | bit) for bit in (1, 2, 4) for i in range(8) if not i & bit])


def box_edges(cells: MapCells) -> NDArray[np.float32]:
    """Lines (24 n, 6), the twelve edges of each box, small cells first: the edges of large ones lie over theirs. Red is
    the number of photons, green two to the power of the level, whose logarithm is its place in the colours."""
    order = np.argsort(-cells.level, kind="stable")
    low, high = cells.low[order], cells.high[order]
    corners = np.where(_CORNERS, high[:, None], low[:, None])
    ends = np.zeros((len(order), len(_EDGES), 2, 6), np.float32)
    ends[..., :3] = corners[:, _EDGES]
    codes = [encoded(values / UNIT) for values in (cells.photons[order], 2.0 ** cells.level[order])]
    ends.view(np.uint32)[..., 4] = (codes[0] | codes[1] << np.uint32(16))[:, None, None]
    return ends.reshape(-1, 6)


class Cells(Overlay):
    """Of the map that is asked for, or of the one that there is."""

    name = "cells"
    switch = Switch(imgui.Key.k, "Shift+K", "Cells of a photon map on or off", shift=True)
    things = "Boxes drawn"

    def __init__(self, shaders: Shaders) -> None:
        super().__init__(shaders)
        self._lines = LineCloud(shaders)
        self._cells: MapCells | None = None

    def needs(self, source: Source) -> Needs | None:
        cells = source.frame.inspection.cells if source.frame is not None else None
        return None if cells is None else (cells, self.style(source.settings).colour)

    def take(self, cells: MapCells, colour: str) -> None:
        self._cells = cells
        self._lines.upload(box_edges(cells), UNIT, self._colouring(colour))

    def release(self) -> None:
        self._cells = None
        self._lines.release()

    def draw_over(self, drawing: Drawing, settings: Settings) -> None:
        style: CellOverlay = self.style(settings)
        self._lines.draw(drawing, self._colouring(style.colour), size=style.size, depth=style.depth, flow=False)

    def count(self, source: Source) -> int | None:
        return None if self._cells is None else len(self._cells.low)

    def legend(self, source: Source) -> None:
        cells = self._cells
        if cells is None:
            nothing_to_draw()
            return
        colouring = self._colouring(self.style(source.settings).colour)
        values = cells.level if colouring is LEVELS else cells.photons
        wrapped(colouring.text if colouring is LEVELS else f"{colouring.text}, logarithmic")
        table = colouring.table(look_of(source.settings.display))
        colour_bar(table, *(grouped(int(end)) for end in (values.min(), values.max())))
        wrapped(drawn_text(cells))

    def _colouring(self, colour: str) -> Colouring:
        """The cells of a grid have no level, whatever the setting says."""
        has_levels = self._cells is not None and self._cells.kind == "kd-tree"
        return LEVELS if colour == "level" and has_levels else PHOTONS


def drawn_text(cells: MapCells) -> str:
    """What is drawn, of what, and how many there are."""
    drawn = len(cells.low)
    if cells.kind == "kd-tree":
        last = int(cells.level.max())
        text = f"kd-tree of the {cells.map} map, levels 0 to {last} of {cells.depth}"
        if drawn < cells.total:
            text += f": the next one is beyond the limit ({grouped(drawn)} of {grouped(cells.total)} boxes)"
        return f"{text}. Part 1 of {cells.parts}." if cells.parts > 1 else f"{text}."
    text = f"{cells.kind.capitalize()} of the {cells.map} map: {grouped(cells.total)} cells hold photons"
    if cells.side > 1:
        text += f", drawn as {grouped(drawn)} boxes of {cells.side} × {cells.side} × {cells.side} cells"
    return f"{text}. Empty ones are not drawn; a cell is two look-up radii wide."
