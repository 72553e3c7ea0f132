"""A pass that takes long: what it says it is at, and stopping it."""

from __future__ import annotations

import time

import numpy as np
import pytest

from pmviewer.engine.session import Session
from pmviewer.settings.access import with_values
from tests.support.scenes import diffuse_box, rendered, settings_of
from tests.support.sessions import PATIENCE, errors, until

SMALL = settings_of(photons={"N": 2000}, render={"passes": 4})


@pytest.fixture
def session():
    opened = Session(threads=2, settings=SMALL)
    yield opened
    opened.close()


def test_a_long_pass_says_what_it_is_at_and_can_be_stopped(session, monkeypatch):
    monkeypatch.setattr("pmviewer.engine.session.LONG_PASS", 0.0)
    monkeypatch.setattr("pmviewer.engine.session.TELL_EVERY", 0.0)
    told = []

    def look():
        status = session.status
        if status.stage:
            told.append((status.stage, status.stage_progress, status.state))

    session.on_update = look
    session.set(with_values(SMALL, {"photons.N": 3_000_000}))
    session.open(diffuse_box())
    until(lambda: [share for stage, share, _ in told if stage == "light pass" and share is not None and share < 0.8])
    session.stop()
    until(lambda: session.status.state == "paused")
    assert {state for _, _, state in told} == {"rendering"}
    shares = [share for stage, share, _ in told if stage == "light pass" and share is not None]
    assert all(0 < share <= 1 for share in shares)
    assert session.frame.coarse, "the pass was dropped"
    serial = session.frame.serial
    time.sleep(0.3)
    assert session.frame.serial == serial, "nothing goes on"
    session.set(SMALL)
    until(lambda: session.status.state == "paused" and not session.frame.coarse)
    session.resume()
    assert session.wait(timeout=PATIENCE)
    assert np.array_equal(session.frame.planes, rendered(diffuse_box(), SMALL, 4).film.planes())
    assert errors(session) == []


def test_stopping_between_passes_pauses_and_keeps_the_film(session):
    session.open(diffuse_box())
    assert session.wait(timeout=PATIENCE)
    session.stop()
    session.set(with_values(SMALL, {"render.passes": 6}))
    session.resume()
    assert session.wait(timeout=PATIENCE)
    assert session.frame.statistics.passes == 6
