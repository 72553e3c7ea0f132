"""Noise of the film as its passes tell it, against noise that is known: made up, or the spread of other seeds."""

import numpy as np
import pytest

from pmviewer.engine.diagnose import noise_plane
from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.opened import open_scene
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.render.film import Film
from pmviewer.render.moments import Moments
from pmviewer.render.planes import CHANNELS, MEDIA_CHANNELS, beauty_of
from pmviewer.settings.access import Settings, with_values

SMALL = {"camera.width": 32, "camera.height": 32, "photons.N": 4000, "render.method": "progressive"}


@pytest.fixture(scope="module")
def opened():
    return open_scene("cornell_caustic")


def renderer(opened, pool, **values):
    return Renderer(opened, with_values(Settings(), SMALL | values), pool, StageStore(0))


def told(samples, channels=CHANNELS):
    """Moments of passes whose samples (passes, pixels, 3) are all direct light."""
    sums, moments = np.zeros((samples.shape[1], channels)), Moments(samples.shape[1])
    for sample in samples:
        sums[:, 3:6] += sample
        sums[:, 15:22] += 7.0  # properties of the first hit are no light
        moments.add(sums, channels, 0, len(sums))
        moments.close_pass()
    return moments


@pytest.mark.parametrize("passes", [8, 13])
def test_independent_passes_have_the_error_of_a_mean(passes):
    """Of pixels with mean 2 and standard deviation ½: ¼ over the passes; relative to 4 + ε. No pass helps another."""
    samples = np.random.default_rng(1).normal(2.0, 0.5, (passes, 4000, 3))
    moments = told(samples)
    assert moments.efficiency == pytest.approx(1.0, abs=0.03)
    assert moments.relmse() == pytest.approx(0.25 / passes / 4.01, rel=0.04)
    expected = samples.std(axis=0, ddof=1) / np.sqrt(passes)
    np.testing.assert_allclose(moments.standard_errors(), expected * np.sqrt(moments.efficiency), rtol=1e-9)


def test_passes_that_complement_each_other_leave_less():
    """Means of a stratified pass and its mirror image are exact, and halves agree."""
    x = np.random.default_rng(2).normal(0.0, 0.5, (8, 500, 3))
    pairs = np.stack([2 + x, 2 - x], axis=1).reshape(16, 500, 3)
    assert told(pairs).relmse() < 1e-20


def test_light_in_media_counts():
    sums = np.ones((1, MEDIA_CHANNELS))
    moments = Moments(1)
    moments.add(sums, MEDIA_CHANNELS, 0, 1)
    np.testing.assert_array_equal(moments.image, [[7.0, 7.0, 7.0]])


def test_one_pass_tells_nothing(opened, pool):
    one = renderer(opened, pool)
    one.step()
    assert one.film.moments.relmse() is None
    assert (noise_plane(one.film)["noise"] == -1).all()
    assert (noise_plane(Film(2, 2))["noise"] == -1).all()


def test_the_estimate_is_the_spread_of_other_seeds(opened, pool):
    """The estimate of a run, and per pixel, against how twelve runs differ, whose own mean is known to a twelfth."""
    pictures, noise, relative, errors = [], [], [], []
    for seed in range(12):
        one = renderer(opened, pool, **{"render.seed": 100 + seed})
        for _ in range(16):
            one.step()
        frame = one.frame(0)
        pictures.append(beauty_of(frame.planes).astype(float))
        noise.append(one.film.moments.relmse())
        relative.append(noise_plane(one.film)["noise"][..., 0])
        errors.append(one.film.moments.standard_errors())
    pictures = np.array(pictures)
    mean, variance = pictures.mean(axis=0), pictures.var(axis=0, ddof=1)
    spread = float((variance / (mean**2 + 0.01)).mean())
    assert np.mean(noise) == pytest.approx(spread, rel=0.3)
    assert all(0.4 < estimate / spread < 2.5 for estimate in noise)
    known = np.sqrt(np.mean(np.square(errors), axis=0)).mean(axis=-1)
    seen = np.sqrt(variance).mean(axis=-1).reshape(-1)
    assert np.corrcoef(np.log(known + 1e-4), np.log(seen + 1e-4))[0, 1] > 0.8
    np.testing.assert_allclose([np.mean((r / 100) ** 2) for r in relative], noise, rtol=1e-5)


def test_the_film_does_not_change(opened, pool):
    plain, told_ = renderer(opened, pool), renderer(opened, pool)
    plain.film.moments = None
    for one in (plain, told_):
        one.step()
        one.step()
    np.testing.assert_array_equal(plain.film.sums, told_.film.sums)


def test_quotients_of_sums_have_no_such_noise(opened, pool):
    """Filters divide nothing, those with negative parts neither."""
    for name in ("Lanczos", "Gaussian"):
        settings = with_values(Settings(), SMALL | {"render.filter": name})
        assert inactive_reason("display.view=noise", settings, opened.traits) is None
        assert Renderer(opened, settings, pool, StageStore(0)).film.moments is not None
    settings = with_values(Settings(), SMALL | {"render.method": "virtual lights"})
    assert "divide sums" in inactive_reason("display.view=noise", settings, opened.traits)
