"""What is said on the standard error: what a scene that takes long is doing, and warnings."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager

PATIENCE = 2.0
"""Seconds that a scene may take to load without a word."""


@contextmanager
def patiently() -> Iterator[Callable[[str], None]]:
    """Gives what prints the loader's stages once loading has taken `PATIENCE` seconds, first the one it is in then."""
    lock, current, late = threading.Lock(), "", False

    def show(text: str) -> None:
        print(f"{text} …", file=sys.stderr, flush=True)

    def tell(text: str) -> None:
        nonlocal current
        with lock:
            current = text
            if late:
                show(text)

    def begin() -> None:
        nonlocal late
        with lock:
            late = True
            if current:
                show(current)

    timer = threading.Timer(PATIENCE, begin)
    timer.daemon = True
    timer.start()
    try:
        yield tell
    finally:
        timer.cancel()


def print_warnings(warnings: Iterable[str], dropped: Mapping[str, int]) -> None:
    """Sentences on the standard error, and what was left out how often."""
    for warning in warnings:
        print(f"pmviewer: warning: {warning}", file=sys.stderr)
    for reason, count in dropped.items():
        print(f"pmviewer: warning: {count} × {reason} left out", file=sys.stderr)
