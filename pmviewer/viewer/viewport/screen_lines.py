"""Points and lines of the scene on the screen, and the mouse among them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.render.camera import CameraPose

Point = tuple[float, float]
_BEFORE = 1e-3
"""Of a line's length: how far before the eye it is cut off."""
_PARALLEL = 1e-6
"""Sine squared of the angle below which two lines have no nearest points to be told."""


@dataclass(frozen=True)
class Screen:
    """Where a camera's picture lies in the window: `rectangle` (left, top, width, height) from the viewport's
    `origin`, in points."""

    pose: CameraPose
    origin: Point
    rectangle: tuple[float, float, float, float]

    def place(self, point: NDArray[np.float64]) -> Point | None:
        """Of a point (3,) of the scene; None behind the camera."""
        x, y, depth = self.pose.project(point[None])[0]
        if depth <= 0 and not self.pose.orthographic:
            return None
        return self._in_window(x, y)

    def segment(self, a: NDArray[np.float64], b: NDArray[np.float64]) -> tuple[Point, Point] | None:
        """A line from a to b (3,), as far as it is before the camera; None where all of it is behind."""
        a, b = np.asarray(a, float), np.asarray(b, float)
        if not self.pose.orthographic:
            _, _, forward = self.pose.axes()
            least = _BEFORE * float(np.linalg.norm(b - a))
            depths = (np.stack([a, b]) - np.asarray(self.pose.origin, float)) @ forward - least
            if depths.max() <= 0:
                return None
            if depths.min() < 0:
                cut = a + (b - a) * depths[0] / (depths[0] - depths[1])
                a, b = (cut, b) if depths[0] < 0 else (a, cut)
        (ax, ay, _), (bx, by, _) = self.pose.project(np.stack([a, b]))
        return self._in_window(ax, ay), self._in_window(bx, by)

    def nearest(self, x: float, y: float, a: NDArray[np.float64], b: NDArray[np.float64]) -> float | None:
        """Where the line through a and b (3,) is nearest to the ray through a place in the window: 0 at a, 1 at b. None
        where the ray runs along it."""
        left, top, width, height = self.rectangle
        column = (x - self.origin[0] - left) * self.pose.width / width
        row = (y - self.origin[1] - top) * self.pose.height / height
        origins, directions = self.pose.rays(np.array([column]), np.array([row]))
        d, way, start = directions[0], b - a, a - origins[0]
        length = float(way @ way)
        across = float(way @ d)
        sine = length - across * across
        if sine <= _PARALLEL * length:
            return None
        return float(((d @ start) * across - way @ start) / sine)

    def _in_window(self, x: float, y: float) -> Point:
        left, top, width, height = self.rectangle
        return (
            float(self.origin[0] + left + x * width / self.pose.width),
            float(self.origin[1] + top + y * height / self.pose.height),
        )
