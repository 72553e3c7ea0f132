"""Ctrl+C while passes are rendered: the first one waits for the end of the pass, so that the film stays whole."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def interrupts_between_passes() -> Iterator[Callable[[], None]]:
    """Gives what is to be called after each pass: it raises KeyboardInterrupt (or does whatever the program does on an
    interrupt) if one came meanwhile. A second one acts at once.

    On other threads than the main one, which alone gets interrupts, and where the program ignores them, nothing is
    done.
    """
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield lambda: None
        return
    came = False

    def note(number: int, stack: FrameType | None) -> None:
        nonlocal came
        if came:
            before(number, stack)
        came = True

    def act() -> None:
        nonlocal came
        if came:
            came = False
            before(signal.SIGINT, None)

    signal.signal(signal.SIGINT, note)
    try:
        yield act
    finally:
        signal.signal(signal.SIGINT, before)
    act()
