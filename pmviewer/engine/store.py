"""Results of stages, kept by what they were made from, so that a changed setting recomputes only what follows."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any

BUDGET = 1 << 30
"""Bytes of results that are kept; the ones unused for longest go first."""
KEPT_PASSES = 4
"""Photons and maps of the first passes are kept, so that a new camera or radius starts from them."""


class StageStore:
    """A least-recently-used store with a budget in bytes. Not thread-safe: the session's worker owns it.

    Light passes below the number `passes` put their photons and maps here."""

    def __init__(self, budget: int = BUDGET) -> None:
        self.budget = budget
        self.bytes = 0
        self.passes = KEPT_PASSES
        self._entries: OrderedDict[Hashable, tuple[Any, int]] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], Any], size: Callable[[Any], int]) -> Any:
        """The value made for `key` before, or a new one by `make`; `size` tells its bytes."""
        if key in self._entries:
            self._entries.move_to_end(key)
            return self._entries[key][0]
        value = make()
        needed = size(value)
        if needed <= self.budget // 2:
            self._entries[key] = value, needed
            self.bytes += needed
            self.shrink(self.budget)
        return value

    def shrink(self, size: int) -> None:
        """Forget what was unused for longest, down to so many bytes."""
        while self.bytes > size:
            _, (_, freed) = self._entries.popitem(last=False)
            self.bytes -= freed

    def clear(self) -> None:
        """Forget all results."""
        self._entries.clear()
        self.bytes = 0
