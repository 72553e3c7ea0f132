"""The first photons of some path classes."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import kernel


def first_in_classes(photons: np.ndarray, mask: int, most: int) -> np.ndarray:
    """The first `most` of photons (n, 6) that are on a path whose class has its bit in the mask, (≤ most, 6)."""
    found = np.empty((min(most, len(photons)), 6), np.float32)
    return found[: _take(photons.view(np.uint32), mask, found.view(np.uint32))]


@kernel
def _take(words, mask, found):
    """Those of photons (n, 6) to found (m, 6), both uint32, until it is full; returns how many."""
    count = 0
    for i in range(len(words)):
        if count == len(found):
            break
        if (mask >> np.int64((words[i, 3] >> np.uint32(6)) & np.uint32(3))) & 1:
            for w in range(6):
                found[count, w] = words[i, w]
            count += 1
    return count
