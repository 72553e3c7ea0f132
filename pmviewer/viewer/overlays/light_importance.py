"""Lights as points, by how much of the picture each one lights, with the share beside those that matter most."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from pmviewer.render.camera import CameraPose
from pmviewer.settings.access import LightOverlay
from pmviewer.viewer.gl.palette import By, Colouring
from pmviewer.viewer.gl.records import encoded
from pmviewer.viewer.overlays.legend import wrapped
from pmviewer.viewer.overlays.overlay import Needs, Source, Switch
from pmviewer.viewer.overlays.points import Points
from pmviewer.viewer.panels.light_list import light_rows, top_lights
from pmviewer.viewer.viewport.caption import caption

if TYPE_CHECKING:
    from pmviewer.photons.emission.light_importance import LightImportance
    from pmviewer.viewer.viewport.viewport import Viewport

_LISTED = 8


def light_points(lights: LightImportance, places: NDArray[np.float64]) -> NDArray[np.float32]:
    """Records (n, 6) of the lights that have a place: red is the share of the picture's light that comes from each,
    green how many times as many photons leave it as by its power."""
    shown = np.flatnonzero(np.isfinite(places).all(axis=1))
    rows = np.zeros((len(shown), 6), np.float32)
    rows[:, :3] = places[shown]
    words = rows.view(np.uint32)
    words[:, 4] = encoded(lights.lit[shown]) | encoded(lights.factor[shown]) << np.uint32(16)
    words[:, 5] = (shown.astype(np.uint32) & np.uint32(0xFFFF)) << np.uint32(16)
    return rows


def projected(camera: CameraPose, point: NDArray[np.floating]) -> tuple[float, float] | None:
    """Where a point is in the picture, from (0, 0) top left to (1, 1); None where the camera doesn't see it."""
    if not np.isfinite(point).all():
        return None
    seen = camera.view_matrix() @ np.append(point, 1.0)
    if not seen[2] < 0:
        return None
    clip = camera.projection_matrix(1e-3, 1.0) @ seen
    x, y = 0.5 + 0.5 * clip[0] / clip[3], 0.5 - 0.5 * clip[1] / clip[3]
    return (float(x), float(y)) if 0 <= x <= 1 and 0 <= y <= 1 else None


def clear_of(
    place: tuple[float, float], taken: list[tuple[float, float]], size: tuple[float, float]
) -> tuple[float, float]:
    """The place, or the next one below it, where a label of that size covers none of those that are there."""
    x, y = place
    while any(abs(x - other[0]) < size[0] and abs(y - other[1]) < size[1] for other in taken):
        y = min(other[1] for other in taken if abs(x - other[0]) < size[0] and other[1] > y - size[1]) + size[1]
    return x, y


class Lights(Points):
    """Those that have a place, coloured by their share of the picture's light or of the photons."""

    name = "lights"
    switch = Switch(imgui.Key.l, "L", "Importance of the lights on or off")
    things = "Lights that have a place in the scene"
    colourings: ClassVar[Mapping[str, Colouring]] = {
        "picture": Colouring(
            By.QUANTITY, 0, scale="share", text="Share of the picture's light that comes from a light"
        ),
        "emission": Colouring(
            By.QUANTITY, 1, scale="around one", text="Photons that leave a light, relative to its power"
        ),
    }

    def needs(self, source: Source) -> Needs | None:
        frame = source.frame
        if frame is None or frame.known_lights is None or frame.light_places is None:
            return None
        return frame.known_lights, frame.light_places

    def take(self, lights: LightImportance, places: NDArray[np.float64]) -> None:  # type: ignore[override]
        self.cloud.upload(light_points(lights, places))

    def count(self, source: Source) -> int | None:
        return self.cloud.summary().total if self.is_shown(source.settings) else None

    def more_legend(self, source: Source) -> None:
        lights = source.frame.known_lights if source.frame is not None else None
        if lights is not None:
            for text, share in light_rows(lights, _LISTED):
                wrapped(f"{text}: {share}")

    def annotate(self, viewport: Viewport, source: Source) -> None:
        """Shares of the most important lights, beside them."""
        frame, camera = source.frame, viewport.shown_camera()
        style: LightOverlay = self.style(source.settings)
        if frame is None or camera is None or frame.known_lights is None or frame.light_places is None:
            return
        left, top, width, height = viewport.rectangle()
        line, taken = imgui.get_text_line_height(), list[tuple[float, float]]()
        for light in top_lights(frame.known_lights, style.labels):
            place = projected(camera, frame.light_places[light])
            if place is not None:
                x, y = left + place[0] * width, top + place[1] * height
                position = x + 0.5 * style.size + 0.4 * line, y - 0.5 * line
                if 0 <= position[0] < viewport.size[0] and 0 <= position[1] < viewport.size[1] - line:
                    text = f"{light + 1}: {frame.known_lights.lit[light]:.1%}"
                    place = clear_of(position, taken, (imgui.calc_text_size(text).x + line, 1.6 * line))
                    taken.append(place)
                    caption(viewport, text, place)
