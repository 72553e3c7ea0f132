"""What is shown in place of young pictures: when, how large, how near to the truth, and never in the film."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.preview import previews
from pmviewer.engine.preview.signals import halved
from pmviewer.engine.session import Session
from pmviewer.output.metric import relmse
from pmviewer.settings.access import with_values
from tests.support.scenes import cornell_box, rendered, settings_of
from tests.support.sessions import PATIENCE, errors

SMALL = settings_of(photons={"N": 4000}, render={"passes": 12})
MOVED = {"camera.fov": 42.0}


@pytest.fixture
def session():
    opened = Session(threads=2, settings=SMALL)
    yield opened
    opened.close()


def shown(session, change):
    """All that the session shows until it has rested after the change, as (frame, preview) in their order."""
    found = []

    def look():
        frame = session.frame
        if frame is not None and (not found or frame is not found[-1]):
            found.append(frame)

    session.on_update = look
    change()
    assert session.wait(timeout=PATIENCE)
    session.on_update = None
    assert errors(session) == []
    return [frame for frame in found if frame.version == session.frame.version]


@pytest.mark.parametrize("method", ["progressive", "gather", "path"])
def test_coarse_frames_are_drawn_out_and_films_are_as_without(session, monkeypatch, method):
    monkeypatch.setattr(previews, "LONG", 0.0)
    settings = with_values(SMALL, {"render.method": method})
    frames = shown(session, lambda: session.open(cornell_box(), settings))
    found = [frame.preview for frame in frames if frame.coarse and frame.preview is not None]
    assert len(found) == 1
    assert found[0].image.shape == (48, 48, 3)
    assert np.isfinite(found[0].image).all()
    assert "coarse" in found[0].caption
    assert all(frame.preview is None for frame in frames if not frame.coarse)
    truth = rendered(cornell_box(), settings, 12).frame(1)
    assert np.array_equal(session.frame.planes, truth.planes)
    emission = truth.image("emission")[..., 0]
    lamp = emission > 0.999 * emission.max()  # pixels that the lamp fills in every pass show it and nothing else
    assert lamp.any()
    assert np.allclose(found[0].image[lamp], truth.beauty[lamp], rtol=0.1)


@pytest.fixture(scope="module")
def truth():
    """From the moved camera, with a fortieth of a pass's variance."""
    return rendered(cornell_box(), with_values(SMALL, {**MOVED, "render.seed": 5}), 40).frame(1).beauty


@pytest.mark.parametrize("drawn_out", [False, True])
def test_a_moved_camera_shows_the_light_of_the_last_picture_for_some_passes(session, monkeypatch, drawn_out, truth):
    monkeypatch.setattr(previews, "LONG", 0.0 if drawn_out else 1e9)
    session.open(cornell_box())
    assert session.wait(timeout=PATIENCE)
    frames = shown(session, lambda: session.set(with_values(SMALL, MOVED)))
    by_passes = {f.statistics.passes: f for f in frames if not f.coarse}
    if not drawn_out:  # the pass is quicker
        assert all(f.preview is None for f in frames if f.coarse)
    else:
        coarse = next(frame for frame in frames if frame.preview is not None)
        assert coarse.coarse
        assert "last picture" in coarse.preview.caption
        assert coarse.preview.image.shape == (48, 48, 3)
        plain = ~by_passes[1].image("specular").any(axis=-1)  # one row of all pixels that show no mirror
        ours, first, true = (picture[plain][None] for picture in (coarse.preview.image, by_passes[1].beauty, truth))
        assert relmse(ours, true) < relmse(first, true)
    first = by_passes[1]
    assert "last picture" in first.preview.caption
    assert relmse(first.preview.image, truth) < 0.6 * relmse(first.beauty, truth)
    assert all(f.preview is None for passes, f in by_passes.items() if passes >= 8)
    assert session.frame.preview is None
    expected = rendered(cornell_box(), with_values(SMALL, MOVED), 12).frame(1)
    assert np.array_equal(session.frame.planes, expected.planes)


def test_other_changes_forget_the_last_picture(session, monkeypatch):
    monkeypatch.setattr(previews, "LONG", 0.0)
    session.open(cornell_box())
    assert session.wait(timeout=PATIENCE)
    frames = shown(session, lambda: session.set(with_values(SMALL, {"photons.N": 5000})))
    captions = [frame.preview.caption for frame in frames if frame.preview is not None]
    assert captions
    assert not any("last picture" in how for how in captions)


def test_off_is_off_and_a_pause_shows_the_estimate(session):
    frames = shown(session, lambda: session.open(cornell_box(), with_values(SMALL, {"display.preview": "off"})))
    assert all(frame.preview is None for frame in frames)
    session.pause()
    session.set(with_values(SMALL, MOVED))
    assert session.wait(passes=1, timeout=PATIENCE)
    assert session.status.state == "paused"
    assert session.frame.preview is None


def test_denoised_previews_are_nearer_to_the_truth_and_end_with_the_picture(session):
    settings = with_values(SMALL, {"display.preview": "denoised"})
    frames = shown(session, lambda: session.open(cornell_box(), settings))
    truth = rendered(cornell_box(), with_values(SMALL, {"render.seed": 5}), 40).frame(1).beauty
    by_passes = {f.statistics.passes: f for f in frames if not f.coarse and f.preview is not None}
    assert "denoised" in by_passes[1].preview.caption
    assert relmse(by_passes[1].preview.image, truth) < 0.7 * relmse(by_passes[1].beauty, truth)
    assert session.frame.preview is None


def test_pictures_too_large_for_it_have_none(session, monkeypatch):
    monkeypatch.setattr(previews, "LONG", 0.0)
    monkeypatch.setattr(previews, "MOST_PIXELS", 1000)
    frames = shown(session, lambda: session.open(cornell_box()))
    frames += shown(session, lambda: session.set(with_values(SMALL, MOVED)))
    assert all(frame.preview is None for frame in frames)


def test_methods_without_first_hits_have_none(session):
    estimated = {"render.method": "gather", "gather.estimation": "on"}
    frames = shown(session, lambda: session.open(cornell_box(), with_values(SMALL, estimated)))
    assert all(frame.preview is None for frame in frames)


def test_halved_pictures_are_means():
    picture = np.arange(5 * 6 * 2, dtype=np.float32).reshape(5, 6, 2)
    few = halved(picture)
    assert few.shape == (2, 3, 2)
    assert np.allclose(few[1, 2], picture[2:4, 4:6].mean(axis=(0, 1)))
