"""Edits in a session: the picture is that of the edited scene, bit for bit, whatever happened before."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.session import Session
from pmviewer.scene.arrays.tessellate import tessellate
from pmviewer.settings.access import Settings, with_values
from tests.support.scenes import diffuse_box
from tests.support.sessions import errors, until

SMALL = with_values(Settings(), {"photons.N": 2000, "render.passes": 2})


def with_edits(**edits):
    return with_values(SMALL, {"edit.changes": {name.replace("_", "."): value for name, value in edits.items()}})


@pytest.fixture
def session():
    one = Session(threads=2, settings=SMALL)
    one.open(diffuse_box(size=16))
    assert one.wait(timeout=120)
    yield one
    one.close()


def shown(session) -> np.ndarray:
    assert session.wait(timeout=120)
    return session.frame.image()


def test_edits_are_seen_and_taken_back(session):
    plain = shown(session)
    session.set(with_edits(light_1_power=3.0))
    bright = shown(session)
    assert np.allclose(bright, 3 * plain, rtol=2e-4, atol=1e-6), "light adds up"
    session.set(with_edits(light_1_power=3.0, material_1_colour=(0.9, 0.1, 0.1)))
    red = shown(session)
    assert red[..., 0].mean() > 1.2 * bright[..., 0].mean()
    assert red[..., 1].mean() < 0.9 * bright[..., 1].mean()
    session.set(SMALL)
    assert np.array_equal(shown(session), plain)


def test_a_scene_opened_with_edits_has_the_same_picture(session):
    settings = with_edits(object_1_move=(0.0, 0.1, 0.0), light_1_power=0.5)
    session.set(settings)
    live = shown(session)
    session.open(diffuse_box(size=16), settings)
    until(lambda: not session.loading)
    assert np.array_equal(shown(session), live)


def test_light_and_colour_build_no_tree_anew_and_give_the_same_picture(session):
    """The tree, the window's triangles and their normals are those of before; a moved object makes others."""
    before, drawn = session.opened_scene.flat, session.geometry
    settings = with_edits(light_1_power=2.0, material_1_colour=(0.2, 0.5, 0.9))
    session.set(settings)
    live, flat = shown(session), session.opened_scene.flat
    assert flat.bvh is before.bvh
    assert session.geometry.vertices is drawn.vertices
    assert not np.array_equal(session.geometry.albedo, drawn.albedo)
    session.open(diffuse_box(size=16), settings)
    until(lambda: not session.loading)
    assert np.array_equal(shown(session), live)
    assert session.opened_scene.flat.bvh is not before.bvh
    assert np.array_equal(session.geometry.albedo, tessellate(session.scene).albedo)
    session.set(with_edits(object_1_move=(0.0, 0.1, 0.0)))
    shown(session)
    assert session.geometry.vertices is not drawn.vertices


def test_while_something_is_dragged_pictures_come_and_the_last_one_is_the_newest(session):
    before, serial = shown(session), session.frame.serial
    for step in range(1, 60):
        session.set(with_edits(light_1_power=1.0 + step / 60))
        if step % 10 == 0:
            until(lambda shown=serial: session.frame.serial > shown)  # or nothing would be seen before the end
            serial = session.frame.serial
    last = shown(session)
    assert np.allclose(last, before * (1 + 59 / 60), rtol=2e-4, atol=1e-6)


def test_what_can_not_be_is_said_once_and_the_picture_stays(session):
    plain = shown(session)
    session.set(with_edits(light_9_power=2.0))
    said: list[str] = []
    until(lambda: said.extend(errors(session)) or said)
    assert "no light '9'" in said[0]
    assert np.array_equal(session.frame.image(), plain)
    session.set(with_edits(light_1_power=2.0))
    assert np.allclose(shown(session), 2 * plain, rtol=2e-4, atol=1e-6)


def test_an_edit_that_arrives_while_another_one_fails_is_not_lost(session, monkeypatch):
    plain, say = shown(session), session._published.say

    def meanwhile(level, text):
        say(level, text)
        if "light '9'" in text:
            session.set(with_edits(light_1_power=2.0))

    monkeypatch.setattr(session._published, "say", meanwhile)
    session.set(with_edits(light_9_power=2.0))
    told: list[str] = []
    until(lambda: told.extend(errors(session)) or (told and not session.loading))
    assert np.allclose(shown(session), 2 * plain, rtol=2e-4, atol=1e-6)


def test_an_edit_that_arrives_while_another_scene_fails_to_open_is_not_lost(session, monkeypatch):
    plain, say = shown(session), session._published.say

    def meanwhile(level, text):
        say(level, text)
        session.set(with_edits(light_1_power=2.0))

    monkeypatch.setattr(session._published, "say", meanwhile)
    session.open("/no/such/scene.toml")
    told: list[str] = []
    until(lambda: told.extend(errors(session)) or (told and not session.loading))
    assert np.allclose(shown(session), 2 * plain, rtol=2e-4, atol=1e-6)


def test_the_scenes_reference_is_not_of_an_edited_scene():
    from pmviewer.engine.comparison.reference import reference_for
    from pmviewer.errors import SceneError

    scene = open_scene("cornell_diffuse").scene
    with pytest.raises(SceneError, match="leave out the edits"):
        reference_for(None, scene, with_edits(light_1_power=2.0))
