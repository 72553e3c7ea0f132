"""Tabulated distributions: which entry of a cumulative table a number belongs to."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import load_f4


@device
def find_interval(address, count, first, u):
    """Index of the first of the cumulative numbers `first` … first+count−1 at `address` (the last one is 1) above u."""
    return find_between(address, np.int64(0), np.int64(count) - 1, first, u)


@device
def find_between(address, low, high, first, u):
    """The same, known to be one of `low` … high."""
    while low < high:
        middle = (low + high) >> 1
        if u < load_f4(address, first + middle):
            high = middle
        else:
            low = middle + 1
    return low
