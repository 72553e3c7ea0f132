"""Increments through memory that both sides see: every bit arrives, and nobody writes where another reads."""

from __future__ import annotations

import os
import sys
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.cluster import nearby
from pmviewer.engine.cluster.nearby import Pieces, Writer
from pmviewer.render.film import Film, Increment

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="such memory is Linux's")
RUN = "a run"


@pytest.fixture
def pieces():
    made = Pieces(Film(8, 5))
    yield made
    made.close()


def increment(weighed=False):
    rng = np.random.default_rng(5)
    sums = rng.normal(size=Film(8, 5).sums.shape)
    sums[0, :4] = np.nan, -0.0, np.inf, 5e-324
    return Increment(sums, rng.normal(size=(40, 2)) if weighed else None)


@pytest.mark.parametrize("weighed", [False, True])
def test_every_bit_arrives(pieces, weighed):
    piece, sent = pieces.take(), increment(weighed)
    found = piece.increment(Writer().write(RUN, piece.place, sent))
    assert found.sums.tobytes() == sent.sums.tobytes()
    assert (found.weights is None) != weighed
    if weighed:
        assert found.weights.tobytes() == sent.weights.tobytes()
    del found
    pieces.give_back(piece)


def test_what_may_still_be_written_to_is_given_to_nobody_else(pieces):
    lost, kept = pieces.take(), pieces.take()
    pieces.lose(lost)
    pieces.give_back(kept)
    assert pieces.take() is kept
    other = pieces.take()
    assert other.place.name not in (lost.place.name, kept.place.name)
    pieces.give_back(kept)
    pieces.give_back(other)


def test_a_late_writer_spoils_nothing_that_came_after(pieces):
    """Its piece was closed, and the descriptor is another's by now."""
    writer, lost = Writer(), pieces.take()
    pieces.lose(lost)
    after = pieces.take()
    assert after.place.descriptor == lost.place.descriptor, "the case that this is about"
    written = writer.write(RUN, after.place, increment())
    assert writer.write(RUN, lost.place, Increment(np.full((40, written.columns), 7.0), None)) is None
    np.testing.assert_array_equal(after.increment(written).sums, increment().sums)
    pieces.give_back(after)


def test_places_that_are_none(pieces):
    piece = pieces.take()
    assert Writer().write(RUN, replace(piece.place, process=2**22), increment()) is None
    assert Writer().write(RUN, replace(piece.place, descriptor=10**6), increment()) is None
    small = replace(piece.place, bytes=4096)
    assert Writer().write(RUN, small, increment()) is None, "it is too small"
    pieces.give_back(piece)


def test_no_more_memory_than_allowed(monkeypatch):
    film = Film(8, 5)
    monkeypatch.setattr(nearby, "MOST_BYTES", 2 * film.sums.nbytes + 1500)
    pieces = Pieces(film)
    taken = [pieces.take(), pieces.take()]
    assert None not in taken
    assert pieces.take() is None
    pieces.give_back(taken.pop())
    assert pieces.take() is not None


def test_nothing_is_left_open():
    open_now = len(os.listdir("/proc/self/fd"))
    pieces, writer = Pieces(Film(8, 5)), Writer()
    taken = [pieces.take() for _ in range(4)]
    for piece in taken:
        writer.write(RUN, piece.place, increment())
    pieces.lose(taken[0])
    for piece in taken[1:]:
        pieces.give_back(piece)
    pieces.close()
    writer.write("another run", taken[0].place, increment())
    assert len(os.listdir("/proc/self/fd")) == open_now
