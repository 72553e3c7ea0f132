"""Waiting for a session, and what it says."""

from __future__ import annotations

import time
from collections.abc import Callable

from pmviewer.engine.session import Session

PATIENCE = 120.0
"""Seconds that nothing here takes, compiling included."""


def errors(session: Session) -> list[str]:
    """The errors since the last call."""
    return [m.text for m in session.take_messages() if m.level == "error"]


def until(condition: Callable[[], object]) -> None:
    """Wait until the condition holds."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.002)
