"""Memory of passes before, once passes are far smaller."""

from __future__ import annotations

from pmviewer.engine.memory import give_back
from pmviewer.engine.store import StageStore

MUCH_LESS, KEPT_BYTES = 8, 1 << 26
"""From which factor fewer photons make results of before unwanted, and how many bytes of them are kept then."""


class Frugal:
    """After a pass of far more photons, its maps are not kept in the store for a return."""

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
