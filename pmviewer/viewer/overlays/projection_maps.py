"""Projection maps of the lights as translucent cells: of directions on a shell around the light, of places where they
are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import moderngl
import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from pmviewer.settings.access import ProjectionOverlay, Settings
from pmviewer.viewer.format import grouped
from pmviewer.viewer.gl.cells import draw_cells
from pmviewer.viewer.gl.palette import light_colour
from pmviewer.viewer.gl.program import Drawing, Shaders
from pmviewer.viewer.overlays.legend import MOST_SWATCHES, swatches, wrapped
from pmviewer.viewer.overlays.overlay import Needs, Overlay, Source, Switch

if TYPE_CHECKING:
    from pmviewer.photons.projection.light_map import ProjectionMap

DIRECTIONS = ("directions", "world directions")
PLACES = ("places",)
_CORNERS = np.array([(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)])


def is_drawn(cells: ProjectionMap) -> bool:
    """Whether the map has cells: a light whose photons start anywhere has none."""
    return cells.mode in (*DIRECTIONS, *PLACES) and bool(cells.on.any())


def cell_corners(cells: ProjectionMap, radius: float) -> NDArray[np.float64]:
    """(n, 4, 3): the corners of each cell that is on, in the order (row, column), (+1, 0), (+1, +1), (0, +1).
    `radius` is that of the shell."""
    rows, columns = np.nonzero(cells.on)
    row = rows[:, None] + np.array([0, 1, 1, 0])
    phi = (columns[:, None] + np.array([0, 0, 1, 1])) * (2 * np.pi / cells.on.shape[1])
    edge = cells.edges[row]
    across = np.cos(phi)[..., None] * cells.axes[0] + np.sin(phi)[..., None] * cells.axes[1]
    if cells.mode in PLACES:
        return cells.origin + edge[..., None] * across
    return cells.origin + radius * (np.sin(edge)[..., None] * across + np.cos(edge)[..., None] * cells.axes[2])


def cell_vertices(cells: ProjectionMap, radius: float, tint: Sequence[float]) -> NDArray[np.float32]:
    """(n, 8): position, place in the cell and colour of the corners of two triangles a cell."""
    corners = cell_corners(cells, radius)
    data = np.empty((len(corners), 6, 8), np.float32)
    data[..., :3] = corners[:, [0, 1, 2, 0, 2, 3]]
    data[..., 3:5] = _CORNERS
    data[..., 5:] = tint
    return data.reshape(-1, 8)


class ProjectionMaps(Overlay):
    """Lights have the colours of the palette in turn."""

    name = "projection"
    switch = Switch(imgui.Key.m, "M", "Projection maps of the lights on or off")
    rank = -1

    def __init__(self, shaders: Shaders) -> None:
        super().__init__(shaders)
        self._buffer: moderngl.Buffer | None = None
        self._array: moderngl.VertexArray | None = None
        self._lights: tuple[tuple[int, str, float], ...] = ()
        """Number, name and share of the power that is covered, of the lights that are drawn."""
        self._other_lights, self._denser = 0, 0
        """Lights without cells; of these, those whose photons start more densely for what stands on a wide floor."""

    def needs(self, source: Source) -> Needs | None:
        style: ProjectionOverlay = self.style(source.settings)
        maps = source.frame.projections.get(style.map) if source.frame is not None else None
        return None if maps is None else (maps, style.size * source.scene_radius)

    def take(self, maps: Sequence[ProjectionMap], radius: float) -> None:
        """One map a light; shells have that radius."""
        self.release()
        shown = [(number, cells) for number, cells in enumerate(maps) if is_drawn(cells)]
        self._lights = tuple((number, cells.light, cells.share) for number, cells in shown)
        self._other_lights = len(maps) - len(shown)
        self._denser = sum(cells.denser for cells in maps)
        if shown:
            vertices = [cell_vertices(cells, radius, light_colour(number)) for number, cells in shown]
            self._buffer = self.shaders.context.buffer(np.concatenate(vertices))
            content = [(self._buffer, "3f4 2f4 3f4", "position", "corner", "tint")]
            self._array = self.shaders.array("cells", content)

    def release(self) -> None:
        if self._array is not None:
            self.shaders.drop(self._array)
        if self._buffer is not None:
            self._buffer.release()
        self._array = self._buffer = None
        self._lights, self._other_lights, self._denser = (), 0, 0

    def draw_over(self, drawing: Drawing, settings: Settings) -> None:
        if self._array is None:
            return
        style: ProjectionOverlay = self.style(settings)
        draw_cells(self.shaders, self._array, drawing, style.opacity, style.depth)

    def legend(self, source: Source) -> None:
        shown = self._lights[:MOST_SWATCHES]
        swatches("", [(f"{name}, {share:.0%} of its power", light_colour(number)) for number, name, share in shown])
        if len(self._lights) > MOST_SWATCHES:
            imgui.text_disabled(f"and {len(self._lights) - MOST_SWATCHES} more")
        if self._other_lights:
            said = f"Lights without cells: {grouped(self._other_lights)}. Their photons start anywhere"
            wrapped(said + (", more of them for what stands on the floor." if self._denser else "."))
        elif not self._lights:
            wrapped("No maps: they would spare too little here (photons.projection = on makes them).")
