"""What is pinned, over the picture: the pixel, its eye path, the disc and the photons of the chosen look-up, the path
of the chosen photon, and the virtual lights that reach the pixel. Surfaces hide none of it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from pmviewer.engine.inspector.report import LitPlace, LookUp, PixelReport, luminance
from pmviewer.settings.access import Settings
from pmviewer.viewer import theme
from pmviewer.viewer.gl.marks import Marks, Strokes
from pmviewer.viewer.gl.program import Drawing, Shaders
from pmviewer.viewer.inspector import ChosenLight
from pmviewer.viewer.overlays.overlay import Needs, Overlay, Source

if TYPE_CHECKING:
    from pmviewer.viewer.viewport.viewport import Viewport

DISC_COLOUR = theme.ACCENT[:3]
LOW, HIGH = (0.45, 0.30, 0.10), (1.0, 0.93, 0.62)
"""Of photons that add nothing and of the one that adds most."""
DIM_LIGHT, BRIGHT_LIGHT = (0.10, 0.32, 0.22), (0.62, 1.0, 0.78)
"""Of virtual lights, likewise."""
REACH_COLOUR = (0.36, 0.78, 0.55)
MOST_REACHING = 16
"""Virtual lights that lines are drawn to, those that add most."""
CHOSEN_COLOUR = (0.30, 0.85, 1.0)
WAY_COLOUR = (0.85, 0.85, 0.85)
SMALLEST, LARGEST, CHOSEN_SIZE, LIGHT_SIZE = 2.5, 7.0, 9.0, 5.0
"""Of a photon's disc in points, by how far apart they are; of the chosen one's; of a virtual light's."""
_AROUND = 64
_SHORTEST = 6.0
"""The pinned pixel is framed at least so wide, in points."""


def disc_lines(p: NDArray[np.floating], n: NDArray[np.floating], radius: float) -> NDArray[np.float64]:
    """The rim (2m, 3) of a disc around p with unit normal n, and its normal, half as long as the radius."""
    t = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    t /= np.linalg.norm(t)
    b = np.cross(n, t)
    angle = np.linspace(0, 2 * np.pi, _AROUND + 1)[:, None]
    rim = p + radius * (np.cos(angle) * t + np.sin(angle) * b)
    return np.concatenate([chain(rim), [p, p + 0.5 * radius * n]])


def chain(points: NDArray[np.floating]) -> NDArray[np.float64]:
    """Lines (2m, 3) from each of points (m + 1, 3) to the next."""
    return np.stack([points[:-1], points[1:]], axis=1).reshape(-1, 3).astype(np.float64)


def levels(look_up: LookUp) -> NDArray[np.float64]:
    """How bright its photons are drawn, (m,), by what they add to the pixel."""
    return brightness(look_up.found.adds)


def brightness(adds: NDArray[np.float64]) -> NDArray[np.float64]:
    """In 0 … 1, (m,), of what adds (m, 3) to the pixel."""
    Y = luminance(adds)
    return np.asarray(np.sqrt(Y / max(float(Y.max(initial=0.0)), 1e-30)))


def spokes(p: NDArray[np.floating], points: NDArray[np.floating]) -> NDArray[np.float64]:
    """Lines (2m, 3) from p to each of points (m, 3)."""
    return np.stack([np.broadcast_to(p, points.shape), points], axis=1).reshape(-1, 3).astype(np.float64)


class Inspected(Overlay):
    """Drawn while a pixel is pinned; it has no settings."""

    name = "inspected"
    by_settings = False
    rank = 2

    def __init__(self, shaders: Shaders) -> None:
        super().__init__(shaders)
        self._way, self._disc, self._path = Strokes(shaders), Strokes(shaders), Strokes(shaders)
        self._photons, self._chosen = Marks(shaders), Marks(shaders)
        self._reach, self._lights = Strokes(shaders), Marks(shaders)
        self._held = False
        self._place: tuple[NDArray[np.float64], float, int] | None = None

    @classmethod
    def style(cls, settings: Settings) -> Any:
        return None

    @classmethod
    def is_shown(cls, settings: Settings) -> bool:
        return True

    @classmethod
    def tests_depth(cls, settings: Settings) -> bool:
        return False

    @property
    def active(self) -> bool:
        return self._held

    def needs(self, source: Source) -> Needs | None:
        report = source.inspector.report if source.inspector is not None else None
        if report is None or source.inspector is None:
            return None
        inspector = source.inspector
        return report, inspector.look_up_of(report), inspector.lit_of(report), inspector.light

    def take(
        self,
        report: PixelReport,
        look_up: LookUp | None,
        lit: LitPlace | None = None,
        light: ChosenLight | None = None,
    ) -> None:
        self.release()
        self._held = True
        if len(report.way) > 2:  # seen over mirrors: what the camera sees directly is a point
            self._way.upload(chain(report.way[1:]))
        self._place = None if look_up is None else (look_up.p, look_up.radius, look_up.found.n)
        if look_up is not None:
            self._disc.upload(disc_lines(look_up.p, look_up.n, look_up.radius))
            self._photons.upload(look_up.found.records[:, :3], levels(look_up))
        if lit is not None:
            self._take_lights(lit, light.number if light is not None and light.of_pass == report.index else None)
        life = report.life
        if life is not None and len(life.vertices):
            self._path.upload(chain(life.vertices[:, :3]))
            self._chosen.upload(np.array([life.of.position]), np.ones(1))

    def _take_lights(self, lit: LitPlace, chosen: int | None) -> None:
        self._lights.upload(lit.points, brightness(lit.adds))
        self._reach.upload(spokes(lit.p, lit.points[:MOST_REACHING]))
        at = np.flatnonzero(lit.number == (-1 if chosen is None else chosen))[:1]
        if len(at):
            self._path.upload(spokes(lit.p, lit.points[at]))
            self._chosen.upload(lit.points[at], np.ones(1))

    def release(self) -> None:
        self._held = False
        for part in (
            self._way,
            self._disc,
            self._path,
            self._photons,
            self._chosen,
            self._reach,
            self._lights,
        ):
            part.release()

    def draw_over(self, drawing: Drawing, settings: Settings) -> None:
        self._way.draw(drawing, WAY_COLOUR, 1.5)
        self._reach.draw(drawing, REACH_COLOUR, 1.5)
        self._path.draw(drawing, CHOSEN_COLOUR, 2.0)
        self._photons.draw(drawing, LOW, HIGH, self._size(drawing))
        self._lights.draw(drawing, DIM_LIGHT, BRIGHT_LIGHT, LIGHT_SIZE)
        self._disc.draw(drawing, DISC_COLOUR, 2.0)
        self._chosen.draw(drawing, CHOSEN_COLOUR, CHOSEN_COLOUR, CHOSEN_SIZE)

    def _size(self, drawing: Drawing) -> float:
        """Of a photon's disc: half the distance of photons as they appear, within limits."""
        if self._place is None:
            return SMALLEST
        p, radius, n = self._place
        at = drawing.projection @ drawing.view @ np.append(p, 1.0)
        seen = radius * float(drawing.projection[1, 1]) / max(float(at[3]), 1e-9) * drawing.viewport[1] / 2
        return min(max(0.5 * seen * math.sqrt(math.pi / max(n, 1)) / drawing.pixel_ratio, SMALLEST), LARGEST)

    def annotate(self, viewport: Viewport, source: Source) -> None:
        """A frame around the pinned pixel."""
        camera = viewport.shown_camera()
        if source.inspector is None or source.inspector.pinned is None or camera is None:
            return
        x, y = source.inspector.pinned
        left, top, width, height = viewport.rectangle()
        side = width / camera.width
        half = max(side, _SHORTEST) / 2 + 1
        cx = viewport.origin[0] + left + (x + 0.5) * side
        cy = viewport.origin[1] + top + (y + 0.5) * height / camera.height
        draw = imgui.get_window_draw_list()
        for grow, colour in ((1.0, theme.grey(0.0, 0.8)), (0.0, theme.grey(1.0))):
            corner = half + grow
            draw.add_rect((cx - corner, cy - corner), (cx + corner, cy + corner), imgui.get_color_u32(colour))
