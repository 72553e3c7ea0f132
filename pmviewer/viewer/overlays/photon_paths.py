"""Paths of photons as lines."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from pmviewer.settings.access import PathOverlay, Settings
from pmviewer.viewer.gl.lines import LineCloud
from pmviewer.viewer.gl.palette import BOUNCES, LIGHTS, POWER
from pmviewer.viewer.gl.program import Drawing, Shaders
from pmviewer.viewer.overlays.legend import colour_legend, nothing_to_draw, wrapped
from pmviewer.viewer.overlays.overlay import Needs, Overlay, Source, Switch

if TYPE_CHECKING:
    from pmviewer.photons.light_pass.paths import PhotonPaths

_COLOURINGS = {"power": POWER, "bounce": BOUNCES, "light": LIGHTS}


def flights(paths: PhotonPaths, first: int, length: int) -> NDArray[np.float32]:
    """Ends (2n, 6) of the flights number first … first + length − 1 (from 1) of all paths; both carry the record of
    where the flight ends."""
    vertices = paths.vertices
    ends = np.repeat(vertices[:, 1:, None], 2, axis=2)
    ends[:, :, 0, :3] = vertices[:, :-1, :3]
    number = np.arange(1, vertices.shape[1])
    shown = (number >= first) & (number < first + length) & (number < paths.counts[:, None])
    return np.ascontiguousarray(ends[shown].reshape(-1, 6))


class Paths(Overlay):
    """From light to the end of the trajectory, `length` of them from number `first` on."""

    name = "paths"
    switch = Switch(imgui.Key.p, "P", "Photon paths on or off")

    def __init__(self, shaders: Shaders) -> None:
        super().__init__(shaders)
        self._lines = LineCloud(shaders)

    def needs(self, source: Source) -> Needs | None:
        paths = source.frame.inspection.paths if source.frame is not None else None
        style: PathOverlay = self.style(source.settings)
        return None if paths is None else (paths, style.first, style.length)

    def take(self, paths: PhotonPaths, first: int, length: int) -> None:
        self._lines.upload(flights(paths, first, length), paths.power_unit)

    def release(self) -> None:
        self._lines.release()

    def draw_over(self, drawing: Drawing, settings: Settings) -> None:
        style: PathOverlay = self.style(settings)
        self._lines.draw(drawing, _COLOURINGS[style.colour], size=style.size, depth=style.depth)

    def legend(self, source: Source) -> None:
        lines = self._lines.summary()
        if not lines.total:
            nothing_to_draw()
            return
        colour_legend(_COLOURINGS[self.style(source.settings).colour], lines, "W")
        wrapped("Each line brightens the way the photon flew.")
