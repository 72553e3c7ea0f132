"""Gather rays of a pixel as lines, with points where they end."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from pmviewer.settings.access import GatherOverlay, Settings
from pmviewer.viewer import theme
from pmviewer.viewer.format import grouped, si
from pmviewer.viewer.gl.lines import LineCloud
from pmviewer.viewer.gl.palette import LIGHT_PALETTE, LIGHTS, POWER
from pmviewer.viewer.gl.points import PointCloud
from pmviewer.viewer.gl.program import Drawing, Shaders
from pmviewer.viewer.gl.records import encoded
from pmviewer.viewer.overlays.legend import swatches, wrapped
from pmviewer.viewer.overlays.overlay import Needs, Overlay, Source, Switch
from pmviewer.viewer.viewport.caption import caption

if TYPE_CHECKING:
    from pmviewer.viewer.viewport.viewport import Viewport

MOST_ENDS = 1 << 16
"""Most ends of gather rays that are drawn: all of them."""
_COLOURINGS = {"contribution": POWER, "source": LIGHTS}


def gather_lines(rows: NDArray[np.float32]) -> tuple[NDArray[np.float32], float]:
    """Gather rays (n, 10) of `pmviewer.render.gather.gather_points` as lines (2n, 6) and their unit of radiance. The
    "light" is 0 for rays that follow the BSDF, 1 for those that photons guided."""
    unit = float(rows[:, 6:9].max(initial=0.0)) or 1.0
    ends = np.zeros((len(rows), 2, 6), np.float32)
    ends[:, 0, :3], ends[:, 1, :3] = rows[:, :3], rows[:, 3:6]
    red, green, blue = encoded(rows[:, 6:9] / unit).T
    words = ends.view(np.uint32)
    words[..., 4] = (red | green << 16)[:, None]
    words[..., 5] = (blue | rows[:, 9].astype(np.uint32) << 16)[:, None]
    return ends.reshape(-1, 6), unit


class GatherRays(Overlay):
    """Rays of the pixel that was asked for with I, coloured by what each brings or by who chose its direction."""

    name = "gather"
    switch = Switch(imgui.Key.j, "J", "Gather rays of a pixel on or off")

    def __init__(self, shaders: Shaders) -> None:
        super().__init__(shaders)
        self._rays, self._ends = LineCloud(shaders), PointCloud(shaders)

    def needs(self, source: Source) -> Needs | None:
        rows = source.frame.inspection.gathered if source.frame is not None else None
        return None if rows is None else (rows,)

    def take(self, rows: NDArray[np.float32]) -> None:
        ends, unit = gather_lines(rows)
        self._rays.upload(ends, unit)
        self._ends.upload(ends[1::2], unit)

    def release(self) -> None:
        self._rays.release()
        self._ends.release()

    def draw_over(self, drawing: Drawing, settings: Settings) -> None:
        style: GatherOverlay = self.style(settings)
        colouring = _COLOURINGS[style.colour]
        self._rays.draw(drawing, colouring, size=style.size, depth=style.depth, flow=False)
        self._ends.draw(drawing, colouring, size=min(3.0 * style.size, 12.0), depth=style.depth, limit=MOST_ENDS)

    def legend(self, source: Source) -> None:
        if source.pixel is None:
            wrapped("Hold I over the picture.")
            return
        rays = self._rays.summary()
        wrapped(f"Pixel {source.pixel[0]}, {source.pixel[1]}: {grouped(rays.total)} rays that meet something")
        if self.style(source.settings).colour == "source":
            swatches("Direction by ", [("the BSDF", LIGHT_PALETTE[0]), ("photons", LIGHT_PALETTE[1])])
        elif rays.total:
            low, high = si(rays.power_low, "W/(m² sr)"), si(rays.power_high, "W/(m² sr)")
            wrapped(f"Hue of what a ray adds to the pixel, from {low} to {high}, logarithmic; grey: nothing")

    def annotate(self, viewport: Viewport, source: Source) -> None:
        """How to choose a pixel, until one is chosen."""
        state = viewport.state
        refusal = state.inactive_reason("overlays.gather.show", source.settings, state.session.traits)
        if source.pixel is None and source.frame is not None and refusal is None and not state.flying:
            line = imgui.get_text_line_height()
            text = "hold I over the picture: gather rays of the pixel under the mouse"
            position = viewport.size[0] / 2, viewport.size[1] - 2.2 * line
            caption(viewport, text, position, anchor=0.5, colour=theme.DARK.accent)
