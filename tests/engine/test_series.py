"""Series: each picture is what its settings alone give, whatever came before it."""

from __future__ import annotations

from contextlib import contextmanager

import numpy as np
import pytest

from pmviewer.engine.opened import arrangement_of, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.series.keys import completed_keys, orbits
from pmviewer.engine.series.render import missing, series
from pmviewer.engine.stages.tracer import Tracer
from pmviewer.engine.store import StageStore
from pmviewer.errors import SceneError, SettingError
from pmviewer.settings.access import Settings, with_values
from tests.support.scenes import diffuse_box

SMALL = with_values(Settings(), {"photons.N": 2000, "render.passes": 2})


@pytest.fixture(scope="module")
def opened():
    return open_scene(diffuse_box(size=12))


def test_each_picture_is_that_of_its_settings(opened):
    told = []
    pool = WorkPool(2)
    pictures = [
        SMALL,
        with_values(SMALL, {"camera.origin": (0.1, 0.0, 0.5)}),
        with_values(SMALL, {"edit.changes": {"light.1.power": 2.0}, "photons.N": 1000}),
        SMALL,
    ]
    frames = list(series(opened, pictures, pool, lambda text, share: told.append((text, share))))
    for settings, frame in zip(pictures, frames, strict=True):
        scene = open_scene(diffuse_box(size=12), None, arrangement_of(settings))
        alone = Renderer(scene, settings, pool, StageStore(0))
        alone.step()
        alone.step()
        assert np.array_equal(frame.image(), alone.frame(1).image())
    pool.close()
    assert np.array_equal(frames[0].image(), frames[3].image())
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert told[-1][0] == "picture 4 of 4, pass 2"


def test_photons_are_traced_once_for_a_camera_on_its_way(opened, monkeypatch):
    """Those of all passes, not of the first few alone; and the pictures are the same."""
    traced = []
    trace = Tracer.trace

    def counted(self, index, *args, **more):
        traced.append(index)
        return trace(self, index, *args, **more)

    monkeypatch.setattr(Tracer, "trace", counted)
    pool = WorkPool(1)
    six = with_values(SMALL, {"render.passes": 6, "estimate.radius": 0.05, "photons.renew": "each pass"})
    way = [with_values(six, {"camera.origin": (x, 0.0, 0.5)}) for x in (0.0, 0.05, 0.1)]
    frames = list(series(opened, way, pool, lambda text, share: None))
    assert traced == [0, 1, 2, 3, 4, 5]
    alone = list(missing(opened, way, pool, lambda text, share: None, lambda picture: False, share=False))
    assert traced[6:] == [0, 1, 2, 3, 4, 5] * 3
    pool.close()
    for frame, (_, other) in zip(frames, alone, strict=True):
        assert np.array_equal(frame.image(), other.image())


def test_photons_that_fit_nowhere_are_not_kept(opened, monkeypatch):
    """What has no room is traced for each picture anew; what has is not driven out by it."""
    traced = []
    trace = Tracer.trace
    monkeypatch.setattr(
        Tracer, "trace", lambda self, index, *a, **m: traced.append(index) or trace(self, index, *a, **m)
    )
    pool = WorkPool(1)
    twelve = with_values(SMALL, {"render.passes": 12, "estimate.radius": 0.05})
    monkeypatch.setattr("pmviewer.engine.series.render.BUDGET", 1_000_000)
    monkeypatch.setattr("pmviewer.engine.series.render.available_memory", lambda: 0)
    way = [with_values(twelve, {"camera.origin": (x, 0.0, 0.5)}) for x in (0.0, 0.1)]
    list(series(opened, way, pool, lambda text, share: None))
    pool.close()
    again = traced[12:]
    assert 0 < len(again) < 12
    assert again == list(range(12 - len(again), 12))


def test_what_is_there_is_not_rendered(opened):
    pool, asked = WorkPool(1), []

    def is_there(picture):
        asked.append((picture.number, picture.settings.photons.N))
        return picture.number == 2

    way = [with_values(SMALL, {"photons.N": n}) for n in (500, 1000, 2000)]
    told = list(missing(opened, way, pool, lambda text, share: None, is_there))
    pool.close()
    assert asked == [(1, 500), (2, 1000), (3, 2000)]
    assert [frame is None for _, frame in told] == [False, True, False]


def test_passes_from_elsewhere(opened):
    """Whatever renders them: here the passes of each picture from another renderer, the last one first."""
    pool = WorkPool(1)

    @contextmanager
    def elsewhere(renderer):
        other = Renderer(renderer.scene, renderer.settings, pool, StageStore(0))
        made = {index: other.increment(index) for index in reversed(range(renderer.settings.render.passes))}
        yield lambda: renderer.add(made[renderer.passes])

    way = [SMALL, with_values(SMALL, {"camera.origin": (0.1, 0.0, 0.5)})]
    far = list(missing(opened, way, pool, lambda text, share: None, lambda picture: False, elsewhere))
    near = list(series(opened, way, pool, lambda text, share: None))
    pool.close()
    for (_, frame), other in zip(far, near, strict=True):
        assert np.array_equal(frame.image(), other.image())


def test_keys_get_numbers_where_others_have_some(opened):
    moved = with_values(SMALL, {"camera.origin": (0.1, 0.0, 0.5), "edit.changes": {"light.1.power": 2.0}})
    first, second = completed_keys(opened.scene, opened.whole, [SMALL, moved])
    assert first.camera.origin == tuple(opened.scene.camera.origin)
    assert first.camera.target == "auto", "both have the scene's"
    assert first.edit.changes == {"light.1.power": (1.0,)}
    assert second == moved
    wrong = with_values(SMALL, {"edit.changes": {"light.7.power": 2.0}})
    with pytest.raises(SceneError, match="no light '7'"):
        completed_keys(opened.scene, opened.whole, [SMALL, wrong])


def test_a_colour_begins_with_that_of_the_file(opened):
    blue = with_values(SMALL, {"edit.changes": {"material.1.colour": (0, 0, 1)}})
    first, _ = completed_keys(opened.scene, opened.whole, [SMALL, blue])
    assert first.edit.changes["material.1.colour"] == opened.scene.materials[0].reflectance


def test_without_a_lens_nobody_knows_the_focus(opened):
    lens = with_values(SMALL, {"camera.focus": 0.5, "camera.aperture": 0.01})
    with pytest.raises(SettingError, match=r"camera\.focus is a number in one key and auto in another"):
        completed_keys(opened.scene, opened.whole, [SMALL, lens])


@pytest.mark.parametrize(("degrees", "last"), [(360.0, 315.0), (90.0, 90.0), (-90.0, -90.0)])
def test_an_orbit_keeps_its_distance_and_a_whole_turn_does_not_repeat_the_first(opened, degrees, last):
    camera = opened.scene.camera
    way = orbits(opened.scene, SMALL, 8, degrees)
    target, up = np.asarray(camera.target), np.asarray(camera.up) / np.linalg.norm(camera.up)
    arms = np.array([np.asarray(s.camera.origin) - target for s in way])
    assert np.allclose(arms[0], np.subtract(camera.origin, camera.target))
    assert np.allclose(np.linalg.norm(arms, axis=1), np.linalg.norm(arms[0]))
    flat = arms - np.outer(arms @ up, up)
    angle = np.degrees(np.arctan2(np.cross(flat[0], flat[-1]) @ up, flat[0] @ flat[-1]))
    assert angle == pytest.approx((last + 180) % 360 - 180)
