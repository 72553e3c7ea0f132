"""Records of the irradiance cache as points, with circles as wide as they reach."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from pmviewer.settings.access import CacheOverlay, Settings
from pmviewer.viewer.gl.lines import LineCloud
from pmviewer.viewer.gl.palette import POWER, Colouring
from pmviewer.viewer.gl.program import Drawing, Shaders
from pmviewer.viewer.gl.records import directions
from pmviewer.viewer.overlays.overlay import Needs, Source, Switch
from pmviewer.viewer.overlays.points import MapPoints

MOST_CIRCLES = 2000
CIRCLE_SIDES = 24


def circles(records: NDArray[np.float32], reach: NDArray[np.float32]) -> NDArray[np.float32]:
    """Lines (2n, 6) of a circle around each of at most MOST_CIRCLES records (n, 6) of a cloud whose directions are
    normals, evenly thinned; `reach` (n,) are their radii."""
    stride = max(1, -(-len(records) // MOST_CIRCLES))
    chosen, radii = np.ascontiguousarray(records[::stride]), reach[::stride]
    n = directions(chosen)
    helper = np.where(np.abs(n[:, :1]) < 0.6, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    s = np.cross(n, helper)
    s /= np.linalg.norm(s, axis=1, keepdims=True)
    t = np.cross(n, s)
    angle = np.linspace(0, 2 * np.pi, CIRCLE_SIDES + 1)
    around = np.cos(angle)[:, None, None] * s + np.sin(angle)[:, None, None] * t
    points = chosen[:, :3] + around * radii[:, None]
    ends = np.empty((CIRCLE_SIDES, len(chosen), 2, 6), np.float32)
    ends[:] = chosen[:, None]
    ends[:, :, 0, :3], ends[:, :, 1, :3] = points[:-1], points[1:]
    return ends.reshape(-1, 6)


class IrradianceCache(MapPoints):
    """Points coloured by irradiance; with `circles` on, rings of the radius up to which a record is interpolated."""

    name = "cache"
    switch = Switch(imgui.Key.i, "Shift+I", "Irradiance cache on or off", shift=True)
    things = "Records of the irradiance cache in the latest pass"
    colourings: ClassVar[Mapping[str, Colouring]] = {"irradiance": POWER}
    unit = "W/m²"

    def __init__(self, shaders: Shaders) -> None:
        super().__init__(shaders)
        self._circles = LineCloud(shaders)

    def needs(self, source: Source) -> Needs | None:
        cloud = source.frame.clouds.get(self.name) if source.frame is not None else None
        if cloud is None:
            return None
        style: CacheOverlay = self.style(source.settings)
        return cloud.photons, cloud.power_unit, cloud.reach if style.circles else None

    def take(self, records: NDArray[np.float32], power_unit: float = 1.0, reach: object = None, *_: object) -> None:
        super().take(records, power_unit)
        if isinstance(reach, np.ndarray) and len(records):
            self._circles.upload(circles(records, reach))
        else:
            self._circles.release()

    def release(self) -> None:
        super().release()
        self._circles.release()

    def draw_over(self, drawing: Drawing, settings: Settings) -> None:
        self._circles.draw(drawing, POWER, size=1.0, depth=self.style(settings).depth, flow=False)
