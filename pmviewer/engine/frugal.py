"""Memory that is not needed any more: of passes before, once passes are far smaller, and whatever is free when nothing
is to be done."""

from __future__ import annotations

import threading
from collections.abc import Callable

from pmviewer.engine.store import StageStore
from pmviewer.heap import give_back

MUCH_LESS, KEPT_BYTES = 8, 1 << 26
"""From which factor fewer photons make results of before unwanted, and how many bytes of them are kept then."""

QUIET = 1.0
"""Seconds without work after which what is free goes back to the system."""


class Frugal:
    """After a pass of far more photons, its maps are not kept in the store for a return; while nothing is to be done,
    nothing that is free is kept."""

    def __init__(self, store: StageStore) -> None:
        self._store = store
        self._N = 0
        self._gives_back = False

    def begin(self, N: int) -> None:
        """Passes of N photons begin."""
        if self._N >= MUCH_LESS * N:
            self._store.shrink(KEPT_BYTES)
            self._gives_back = True
        self._N = N

    def after_pass(self, passes: int) -> None:
        """There are so many now: the frame before, with its photons, is gone after the second."""
        if self._gives_back:
            self._gives_back = passes < 2
            give_back()

    def wait(self, changed: threading.Condition, ready: Callable[[], bool]) -> None:
        """Until there is something to do; `changed` is held. Going through what is free takes the time of some
        milliseconds, once in a pause: never between two passes."""
        if changed.wait_for(ready, QUIET):
            return
        changed.release()
        try:
            give_back()
        finally:
            changed.acquire()
        changed.wait_for(ready)
