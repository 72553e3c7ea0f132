"""The choice between implementations, by types where code is compiled and by values in plain Python."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import njit

from pmviewer.kernels.compile.specialise import absent, has, is_a, specialised

PLAIN = np.zeros(1, np.dtype([("scale", np.float32)]))
SHIFTED = np.zeros(1, np.dtype([("shift", np.float32), ("scale", np.float32)]))
PLAIN["scale"], SHIFTED["scale"], SHIFTED["shift"] = 2, 2, 5


class Left(NamedTuple):
    x: Any


class Right(NamedTuple):
    x: Any


@specialised
def stretched(record, x):
    """x times the record's scale, shifted if it has a shift."""
    if has(record, "shift"):

        def shifted(record, x):
            return record.scale * x + record.shift

        return shifted
    return lambda record, x: record.scale * x


@specialised
def side(b, extra):
    """1 for Left, 2 for Right, and 10 more with something extra."""
    more = 0 if absent(extra) else 10
    if is_a(b, Left):
        return lambda b, extra: 1 + more
    return lambda b, extra: 2 + more


@njit
def compiled_stretch(records, x):
    return stretched(records[0], x)


@njit
def compiled_sides(x, extra):
    return side(Left(x), None), side(Right(x), None), side(Left(x), extra), side(Right(x), extra)


@pytest.mark.parametrize(("records", "expected"), [(PLAIN, 6.0), (SHIFTED, 11.0)])
def test_a_record_is_asked_for_its_fields(records, expected):
    assert compiled_stretch(records, 3.0) == expected
    assert stretched(records.view(np.recarray)[0], 3.0) == expected


def test_named_tuples_and_none_are_told_apart():
    expected = (1, 2, 11, 12)
    assert compiled_sides(1.0, 2.0) == expected
    assert (side(Left(1), None), side(Right(1), None), side(Left(1), 2), side(Right(1), 2)) == expected
