"""What the object that is held has received in the latest pass: counted beside the window, while somebody looks."""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pmviewer.engine.frame import Frame
from pmviewer.viewer.background import COUNTING, Background
from pmviewer.viewer.session_link import SessionLike

if TYPE_CHECKING:  # numba, which the window doesn't wait for
    from pmviewer.engine.inspector.received import Received

MAPS = ("global", "caustic", "importons")
"""Clouds whose points are counted, where the frame has them."""
AGAIN_AFTER = 1.0
"""Seconds between two counts while passes go on."""


@dataclass(frozen=True, eq=False)
class Counted:
    """What was counted of a pass, by map; `opened` refers to the scene as it was arranged, `passes` are the film's at
    that time."""

    opened: weakref.ref[Any]
    serial: int
    passes: int
    maps: Mapping[str, Received]
    at: float = field(default_factory=time.monotonic)


class ReceivedByObjects:
    """Methods are for the window's thread."""

    def __init__(self, session: SessionLike, background: Background, frame: Callable[[], Frame | None]) -> None:
        self._session = session
        self._background = background
        self._frame = frame
        self._counted: Counted | None = None
        self._failed = -1
        self._areas: dict[int, float | None] = {}
        self._areas_of: Callable[[], Any] = lambda: None

    def counted(self) -> Counted | None:
        """The newest count of the open scene as it is; another pass is counted soon. None until there is one."""
        opened, frame, known = self._session.opened_scene, self._frame(), self._counted
        if known is not None and known.opened() is not opened:
            known = self._counted = None
        if opened is None or frame is None or frame.coarse or not self._is_of(frame, opened):
            return known
        is_new = known is None or (known.serial != frame.serial and time.monotonic() - known.at > AGAIN_AFTER)
        if is_new and frame.serial != self._failed and not self._background.running(COUNTING):
            self._background.start(COUNTING, "counting photons on objects", lambda: self._count(opened, frame))
        return known

    def area(self, number: int) -> float | None:
        """Of the object's surface in squared scene units, where it is known."""
        opened = self._session.opened_scene
        if opened is None:
            return None
        if self._areas_of() is not opened:
            self._areas, self._areas_of = {}, weakref.ref(opened)
        if number not in self._areas:
            from pmviewer.engine.inspector.received import surface_of

            self._areas[number] = surface_of(opened.scene, number)
        return self._areas[number]

    @staticmethod
    def _is_of(frame: Frame, opened: Any) -> bool:
        """Whether the frame's photons are of the scene as it is arranged now."""
        from pmviewer.engine.opened import arrangement_of

        return frame.scene_name == opened.scene.name and opened.is_arranged(arrangement_of(frame.settings))

    def _count(self, opened: Any, frame: Frame) -> str:
        from pmviewer.engine.inspector.received import received

        self._failed = frame.serial
        maps = {name: received(opened, frame.clouds[name]) for name in MAPS if name in frame.clouds}
        self._counted, self._failed = Counted(weakref.ref(opened), frame.serial, frame.statistics.passes, maps), -1
        return ""
