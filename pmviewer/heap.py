"""The C library's heap in programs that live long: what is free in it goes back to the system. Linux only; elsewhere
nothing is done."""

from __future__ import annotations

import ctypes
import sys

_M_ARENA_MAX = -8
"""Of malloc.h."""


def give_back() -> None:
    """Return to the system what has been freed. The C library of Linux keeps it otherwise: arrays of a batch are below
    the size from which it would not."""
    if not sys.platform.startswith("linux"):
        return
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # musl has none
    if trim is not None:
        trim(0)


def one_heap() -> None:
    """Have all threads share the main heap, where Linux's C library would make eight more a processor. Each keeps what
    is scattered over it, and what is free at the end of another than the main one is out of reach of `give_back`. To
    be called before threads begin: a heap that is there stays. Kernels allocate next to nothing."""
    if not sys.platform.startswith("linux"):
        return
    options = getattr(ctypes.CDLL(None), "mallopt", None)  # musl has none
    if options is not None:
        options(_M_ARENA_MAX, 1)
