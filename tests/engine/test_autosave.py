"""A session that goes on with a film from disk, and keeps its own there."""

from __future__ import annotations

import errno

import numpy as np
import pytest

from pmviewer.engine.checkpoint import autosave, checkpoint
from pmviewer.engine.checkpoint.checkpoint import Job, write_checkpoint
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.session import Session
from pmviewer.engine.store import StageStore
from pmviewer.output.checkpoint_header import read_header
from pmviewer.settings.access import Settings, with_values
from tests.support.sessions import PATIENCE, until

SMALL = with_values(
    Settings(),
    {"camera.width": 20, "camera.height": 16, "photons.N": 2000, "render.passes": 5, "display.autosave": 0.01},
)


def renderer(passes: int) -> Renderer:
    made = Renderer(open_scene("cornell_diffuse"), SMALL, WorkPool(1), StageStore(0))
    for _ in range(passes):
        made.step()
    return made


@pytest.fixture
def film(tmp_path):
    path = tmp_path / "film.checkpoint"
    write_checkpoint(path, renderer(3), Job("cornell_diffuse"))
    return path


@pytest.fixture
def session():
    made = Session(threads=2, settings=SMALL)
    yield made
    made.close()


def texts(session: Session) -> str:
    return "\n".join(message.text for message in session.take_messages())


def test_the_session_goes_on_bit_for_bit(session, film):
    seen = []
    session.on_update = lambda: seen.append(session.frame)
    session.open("cornell_diffuse", SMALL, film=film)
    assert session.wait(timeout=PATIENCE)
    passes = [frame.statistics.passes for frame in seen if frame is not None]
    assert min(passes) == 3
    assert session.frame is not None
    np.testing.assert_array_equal(session.frame.planes, renderer(5).frame(0).planes)
    assert "going on after pass 3" in texts(session)
    session.restart()
    until(lambda: session.frame.statistics.passes < 3)
    assert session.wait(timeout=PATIENCE)
    np.testing.assert_array_equal(session.frame.planes, renderer(5).frame(0).planes)


def test_a_paused_session_shows_the_film(session, film):
    session.pause()
    session.open("cornell_diffuse", SMALL, film=film)
    assert session.wait(passes=3, timeout=PATIENCE)
    until(lambda: session.status.state == "paused")  # told once the film is shown
    assert session.frame.statistics.passes == 3


def test_a_film_that_does_not_fit_begins_anew(session, film, tmp_path):
    session.open("cornell_diffuse", with_values(SMALL, {"photons.N": 2500}), film=film)
    assert session.wait(timeout=PATIENCE)
    assert "begins anew" in (said := texts(session))
    assert "photons.N was 2000 and is 2500" in said
    assert session.frame.statistics.passes == 5
    film.write_bytes(b"nothing")
    session.open("cornell_diffuse", SMALL, film=film)
    until(lambda: session.settings == SMALL and not session.loading)
    assert session.wait(timeout=PATIENCE)
    assert "no whole checkpoint" in texts(session)


def test_films_that_are_worth_it_are_kept(session, tmp_path, monkeypatch):
    path = tmp_path / "kept.checkpoint"
    session.autosave(path)
    session.open("cornell_diffuse", SMALL)
    assert session.wait(timeout=PATIENCE)
    assert not path.exists()  # it took less than WORTH seconds
    monkeypatch.setattr(autosave, "WORTH", 0.0)
    session.restart()
    until(path.exists)
    until(lambda: read_header(path).passes == 5)


def test_a_disk_that_is_full_is_said_once(session, tmp_path, monkeypatch):
    monkeypatch.setattr(autosave, "WORTH", 0.0)
    monkeypatch.setattr(autosave, "SHARE", 0.0)

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(checkpoint, "write_arrays", lambda path, *_, **__: write_full(path, full))
    session.autosave(tmp_path / "kept.checkpoint")
    session.open("cornell_diffuse", with_values(SMALL, {"display.autosave": 1e-6}))
    assert session.wait(timeout=PATIENCE)
    assert texts(session).count("no room on the disk") == 1


def write_full(path, full):
    from pmviewer.output.files import replacing

    with replacing(path, (".checkpoint",)):
        full()
