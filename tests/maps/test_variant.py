"""What records tell kernels: marks, and what stands for a map that there is none of."""

from __future__ import annotations

import functools
import warnings

import numpy as np
import pytest
from numba import njit
from numba.core.errors import NumbaExperimentalFeatureWarning

from pmviewer.kernels.compile.specialise import absent, has, specialised
from pmviewer.maps.search.grid import build_grid
from pmviewer.maps.search.kdtree import build_kdtree
from pmviewer.maps.variant import ABSENT, is_kdtree, looked_up_by, marked

PHOTONS = np.zeros((3, 6), np.float32)
SHORT = np.ones(1, np.dtype([("n", np.int64)]))
LONG = np.ones(1, np.dtype([("n", np.int64), ("more", np.int64)]))


@functools.cache
def map_of(search):
    """A map of the photons that is a grid or a tree."""
    return build_grid(PHOTONS, 1.0) if search == "grid" else build_kdtree(PHOTONS)


@pytest.mark.parametrize("search", ["grid", "tree"])
def test_a_mark_leaves_the_rest_as_it_is(search):
    record = map_of(search).record
    copy = marked(record, "fewest", 7)
    assert copy["fewest"][0] == 7
    for name in record.dtype.names:
        assert copy[name] == record[name]
    assert copy.dtype != record.dtype
    assert looked_up_by(record, "disc") is record
    assert "hull" in looked_up_by(record, "hull").dtype.names


@njit
def compiled_kinds(record, none):
    return kind(record[0]), kind(none)


@specialised
def kind(record):
    """0: nothing, 1: a grid, 2: a kd-tree; 10 more with a hull."""
    if absent(record):
        return lambda record: 0
    number = (2 if is_kdtree(record) else 1) + (10 if has(record, "hull") else 0)
    return lambda record: number


@pytest.mark.parametrize(
    ("search", "mark", "expected"),
    [
        (None, None, 0),
        ("grid", None, 1),
        ("tree", None, 2),
        ("grid", "hull", 11),
        ("tree", "hull", 12),
        ("tree", "differential", 2),
    ],
)
def test_kinds_are_told_apart_compiled_and_not(search, mark, expected):
    record = map_of(search).record if search else ABSENT
    record = marked(record, mark) if mark else record
    assert compiled_kinds(record, None) == (expected, 0)
    assert (kind(record.view(np.recarray)[0]), kind(None)) == (expected, 0)


def told_apart():
    """A kernel that asks of records whether they have the field `more`, straight and through another function."""

    @specialised
    def has_more(record):
        answer = has(record, "more") or has(record, "hull")
        return lambda record: answer

    @njit
    def inner(record):
        return has_more(record)

    @njit
    def of_array(records):
        return inner(records[0]), has_more(records[0])

    return of_array


@pytest.mark.filterwarnings("ignore::numba.core.errors.NumbaExperimentalFeatureWarning")
@pytest.mark.parametrize("order", [(SHORT, LONG), (LONG, SHORT)])
def test_a_record_that_begins_like_another_is_not_taken_for_it(order):
    """Numba's types let a longer record stand for one that it begins with. What is compiled for the one must not be run
    for the other, whichever comes first."""
    ask = told_apart()
    for records in order:
        assert ask(records) == (records is LONG,) * 2


def test_marks_stand_where_numba_does_not_warn():
    ask, subtype = told_apart(), NumbaExperimentalFeatureWarning
    with pytest.warns(subtype, match="subtype"):
        ask(SHORT), ask(LONG)
    with warnings.catch_warnings():
        warnings.simplefilter("error", subtype)
        grid = map_of("grid").record
        for record in (grid, marked(grid, "hull")):
            assert ask(record) == (record is not grid,) * 2
