"""Errors of compared pictures against the reference, worked out once in the background."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any

from pmviewer.engine.frame import Frame
from pmviewer.viewer.background import DIFFERENCES, Background
from pmviewer.viewer.comparison import Comparison
from pmviewer.viewer.gl.textures import Same
from pmviewer.viewer.sides import Side

MOST = 64
"""Figures that are kept."""


class Measured:
    """Methods are for the window's thread."""

    def __init__(self, background: Background, comparison: Comparison, frame: Callable[[], Frame | None]) -> None:
        self._background = background
        self._comparison = comparison
        self._frame = frame
        self._known: dict[Hashable, float | None] = {}

    def error(self, side: Side) -> float | None:
        """relMSE of the picture against the reference: of the live one at its latest measured pass. None where there is
        no reference of its size and camera, or until it is known."""
        reference = self._comparison.reference
        if reference is None or side.size != reference.size:
            return None
        if side.frame is not None and side.frame is self._frame():
            point = self._comparison.latest(side.frame)
            return point.metrics.relmse_all if point is not None else None
        if side.frame is not None and side.frame.coarse:
            return None
        key = side.key, Same(reference.image)
        if key not in self._known and not self._comparison.is_seen_like_the_reference(side.camera):
            self._known[key] = None
        if key not in self._known and not self._background.running(DIFFERENCES):
            self._known = dict(list(self._known.items())[-MOST:])
            self._known[key] = None
            self._start(key, side, reference.image)
        return self._known.get(key)

    def _start(self, key: Hashable, side: Side, truth: Any) -> None:
        def work() -> str:
            from pmviewer.output.metric import relmse

            self._known[key] = relmse(side.image("beauty"), truth)
            return ""

        self._background.start(DIFFERENCES, "measuring a picture", work)
