"""Python's garbage collector rests while numba compiles: it would search some millions of objects that all live, again
and again, for a tenth of the time."""

from __future__ import annotations

import gc

from numba.core import event


class _Rest(event.Listener):
    """Compiling is nested, and one thread's at a time."""

    def __init__(self) -> None:
        self._depth = 0
        self._was_on = False

    def on_start(self, event: event.Event) -> None:
        if self._depth == 0:
            self._was_on = gc.isenabled()
            gc.disable()
        self._depth += 1

    def on_end(self, event: event.Event) -> None:
        self._depth -= 1
        if self._depth == 0 and self._was_on:
            gc.enable()


def install() -> None:
    """From now on, in this process."""
    event.register("numba:compile", _Rest())
