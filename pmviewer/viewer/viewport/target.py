"""Where the picture lies in the panel and in a framebuffer, and how deep the scene is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.render.camera import CameraPose


@dataclass(frozen=True)
class Fit:
    """How the picture lies in the panel: `zoom` 1 shows all of it, `center` is the picture's point (0 to 1) in the
    panel's middle."""

    zoom: float = 1.0
    center: tuple[float, float] = (0.5, 0.5)

    def rectangle(self, panel: tuple[float, float], aspect: float) -> tuple[float, float, float, float]:
        """Left, top, width and height of a picture of that width/height ratio."""
        width = min(panel[0], panel[1] * aspect) * self.zoom
        height = width / aspect
        return panel[0] / 2 - self.center[0] * width, panel[1] / 2 - self.center[1] * height, width, height


@dataclass(frozen=True)
class Target:
    """Where to draw: framebuffer `size` in pixels and the picture's rectangle in it (left, top, width, height), which
    may reach beyond when the user zooms in. `pixel_ratio` scales point sizes (HiDPI)."""

    size: tuple[int, int]
    picture: tuple[int, int, int, int]
    pixel_ratio: float = 1.0

    @property
    def viewport(self) -> tuple[int, int, int, int]:
        """The picture's rectangle as OpenGL counts, from the bottom."""
        left, top, width, height = self.picture
        return left, self.size[1] - top - height, width, height

    def pane(self, number: int) -> tuple[Target, int]:
        """One of two halves beside each other, each with the picture at the same place, and how far to the right it
        begins."""
        half = self.size[0] // 2
        return Target((half, self.size[1]), self.picture, self.pixel_ratio), number * half

    @property
    def clip(self) -> tuple[int, int, int, int] | None:
        """The part of the picture inside the framebuffer, as OpenGL's scissor wants it; None when nothing is."""
        left, top, width, height = self.picture
        x0, x1 = max(left, 0), min(left + width, self.size[0])
        y0, y1 = max(top, 0), min(top + height, self.size[1])
        if x1 <= x0 or y1 <= y0:
            return None
        return x0, self.size[1] - y1, x1 - x0, y1 - y0


def clip_planes(camera: CameraPose, center: NDArray[np.floating], radius: float) -> tuple[float, float]:
    """Near and far distance that enclose a bounding sphere as tightly as the depth buffer needs."""
    if camera.orthographic:
        depth = float((center - np.asarray(camera.origin, float)) @ camera.axes()[2])
        far = max(depth + radius, 1e-3 * radius) * 1.01
        return max(depth - radius, 0.0) * 0.99, far
    distance = float(np.linalg.norm(np.asarray(camera.origin, float) - center))
    far = (distance + radius) * 1.01
    return max((distance - radius) * 0.99, far * 1e-3), far
