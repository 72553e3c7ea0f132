"""Increments through memory that both sides see: every bit arrives, and nobody writes where another reads."""

from __future__ import annotations

import os
import sys
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.cluster import shared_memory
from pmviewer.engine.cluster.shared_memory import Segments, Writer
from pmviewer.render.film import Film, Increment

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="such memory is Linux's")
RUN = "a run"


@pytest.fixture
def segments():
    made = Segments(Film(8, 5))
    yield made
    made.close()


def increment():
    rng = np.random.default_rng(5)
    sums = rng.normal(size=Film(8, 5).sums.shape)
    sums[0, :4] = np.nan, -0.0, np.inf, 5e-324
    return Increment(sums)


def test_every_bit_arrives(segments):
    segment, sent = segments.take(), increment()
    found = segment.increment(Writer().write(RUN, segment.handle, sent))
    assert found.sums.tobytes() == sent.sums.tobytes()
    del found
    segments.give_back(segment)


def test_what_may_still_be_written_to_is_given_to_nobody_else(segments):
    lost, kept = segments.take(), segments.take()
    segments.lose(lost)
    segments.give_back(kept)
    assert segments.take() is kept
    other = segments.take()
    assert other.handle.name not in (lost.handle.name, kept.handle.name)
    segments.give_back(kept)
    segments.give_back(other)


def test_a_late_writer_spoils_nothing_that_came_after(segments):
    """Its segment was closed, and the descriptor is another's by now."""
    writer, lost = Writer(), segments.take()
    segments.lose(lost)
    after = segments.take()
    assert after.handle.descriptor == lost.handle.descriptor, "the case that this is about"
    written = writer.write(RUN, after.handle, increment())
    assert writer.write(RUN, lost.handle, Increment(np.full((40, written.columns), 7.0))) is None
    np.testing.assert_array_equal(after.increment(written).sums, increment().sums)
    segments.give_back(after)


def test_places_that_are_none(segments):
    segment = segments.take()
    assert Writer().write(RUN, replace(segment.handle, process=2**22), increment()) is None
    assert Writer().write(RUN, replace(segment.handle, descriptor=10**6), increment()) is None
    small = replace(segment.handle, bytes=4096)
    assert Writer().write(RUN, small, increment()) is None, "it is too small"
    segments.give_back(segment)


def test_no_more_memory_than_allowed(monkeypatch):
    film = Film(8, 5)
    monkeypatch.setattr(shared_memory, "MOST_BYTES", 2 * film.sums.nbytes + 1500)
    segments = Segments(film)
    taken = [segments.take(), segments.take()]
    assert None not in taken
    assert segments.take() is None
    segments.give_back(taken.pop())
    assert segments.take() is not None


def test_nothing_is_left_open():
    open_now = len(os.listdir("/proc/self/fd"))
    segments, writer = Segments(Film(8, 5)), Writer()
    taken = [segments.take() for _ in range(4)]
    for segment in taken:
        writer.write(RUN, segment.handle, increment())
    segments.lose(taken[0])
    for segment in taken[1:]:
        segments.give_back(segment)
    segments.close()
    writer.write("another run", taken[0].handle, increment())
    assert len(os.listdir("/proc/self/fd")) == open_now
