"""Memory of programs that live long: what is kept for speed alone is let go while nothing is done, and what is free in
the C library's heap goes back to the system (on Linux; elsewhere it stays). Python's collector leaves alone what stays.
"""

from __future__ import annotations

import ctypes
import gc
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache

_M_ARENA_MAX = -8
"""Of malloc.h."""

_kept: list[Callable[[], None]] = []


def keeps(let_go: Callable[[], None]) -> None:
    """Have `give_back` call this: it frees what takes milliseconds to be made anew. Called from any thread, it leaves
    what is in use, and waits for nobody."""
    _kept.append(let_go)


def give_back() -> None:
    """Let go of what is kept for speed alone, and return to the system what has been freed. The C library of Linux
    keeps it otherwise: arrays of a batch are below the size from which it would not."""
    for let_go in _kept:
        let_go()
    if not sys.platform.startswith("linux"):
        return
    trim = getattr(_c_library(), "malloc_trim", None)  # musl has none
    if trim is not None:
        trim(0)


def one_heap() -> None:
    """Have all threads share the main heap, where Linux's C library would make eight more a processor. Each keeps what
    is scattered over it, and what is free at the end of another than the main one is out of reach of `give_back`. To
    be called before threads begin: a heap that is there stays. Kernels allocate next to nothing."""
    if not sys.platform.startswith("linux"):
        return
    options = getattr(_c_library(), "mallopt", None)  # musl has none
    if options is not None:
        options(_M_ARENA_MAX, 1)


@contextmanager
def importing(*, for_long: bool = False) -> Iterator[None]:
    """Within this context Python's collector rests: the engine's modules are some hundred thousand objects that all
    stay, and it would search them several times, for a tenth of the start. `for_long` it never searches what is there
    by the end, in the first such context of a process: that takes some 0.1 s, in which a window would stand still."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if for_long and not gc.get_freeze_count():
            gc.freeze()
        if was_on:
            gc.enable()


@cache
def _c_library() -> ctypes.CDLL:
    return ctypes.CDLL(None)
