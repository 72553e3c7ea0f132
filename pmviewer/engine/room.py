"""Memory given back when photons become far fewer."""

from __future__ import annotations

from pmviewer.engine.memory import give_back
from pmviewer.engine.store import StageStore

MUCH_LESS, KEPT_BYTES = 8, 1 << 26
"""From which factor fewer photons make results of before unwanted, and how many bytes of them are kept then."""


class Room:
    """After a pass of far more photons, its maps in `store` are not kept for a return."""

    def __init__(self, store: StageStore) -> None:
        self._store = store
        self._N, self._gives_back = 0, False

    def make(self, N: int) -> None:
        """Passes of so many trajectories follow."""
        if self._N >= MUCH_LESS * N:
            self._store.shrink(KEPT_BYTES)
            self._gives_back = True
        self._N = N

    def after_pass(self, passes: int) -> None:
        """That many passes are through."""
        if self._gives_back:  # the frame before, with its photons, is gone after this one
            self._gives_back = passes < 2
            give_back()
