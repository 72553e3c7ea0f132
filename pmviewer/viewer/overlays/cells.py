"""Projection maps of the lights as translucent cells: of directions on a shell around the light, of places where they
are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import moderngl
import numpy as np
from numpy.typing import NDArray

from pmviewer.render.camera import Matrix
from pmviewer.settings.access import ProjectionOverlay
from pmviewer.viewer.gl.program import load_program, set_uniforms
from pmviewer.viewer.overlays.overlays import LIGHT_PALETTE

if TYPE_CHECKING:
    from pmviewer.photons.projection.projection import ProjectionMap

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


class CellCloud:
    """Lights have the colours of the palette in turn."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._program = load_program(context, "cells")
        self._buffer: moderngl.Buffer | None = None
        self._array: moderngl.VertexArray | None = None
        self.lights: tuple[tuple[int, str, float], ...] = ()
        """Number, name and share of the power that is covered, of the lights that are drawn."""
        self.other_lights = 0
        """Lights whose photons start anywhere."""

    def upload(self, maps: Sequence[ProjectionMap], radius: float) -> None:
        """Take these maps, one a light; shells have that radius."""
        self.release()
        parts = []
        for number, cells in enumerate(maps):
            if not is_drawn(cells):
                continue
            corners = cell_corners(cells, radius)
            data = np.empty((len(corners), 6, 8), np.float32)
            data[..., :3] = corners[:, [0, 1, 2, 0, 2, 3]]
            data[..., 3:5] = _CORNERS
            data[..., 5:] = LIGHT_PALETTE[number % len(LIGHT_PALETTE)]
            parts.append(data.reshape(-1, 8))
        self.lights = tuple((i, m.light, m.share) for i, m in enumerate(maps) if is_drawn(m))
        self.other_lights = len(maps) - len(self.lights)
        if parts:
            self._buffer = self._context.buffer(np.concatenate(parts))
            self._array = self._context.vertex_array(
                self._program, [(self._buffer, "3f4 2f4 3f4", "position", "corner", "tint")]
            )

    def release(self) -> None:
        """Free what lies on the GPU."""
        if self._array is not None:
            self._array.release()
        if self._buffer is not None:
            self._buffer.release()
        self._array = self._buffer = None
        self.lights, self.other_lights = (), 0

    def draw(self, style: ProjectionOverlay, view: Matrix, projection: Matrix) -> None:
        """Draw into the bound framebuffer. The depth test is the caller's; the depth buffer stays as it is."""
        if self._array is None:
            return
        set_uniforms(self._program, view=view, projection=projection, opacity=style.opacity)
        self._context.enable(moderngl.BLEND)
        self._context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        self._array.render(moderngl.TRIANGLES)
        self._context.disable(moderngl.BLEND)
