"""The exposure that is chosen for pictures without one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pmviewer.engine.exposure import metered
from pmviewer.render.planes import CHANNELS, MEDIA_CHANNELS, PLANES


def planes(light, albedo=0.5, depth=1.0, glow=0.0, size=48):
    """A picture with that much direct light (a number or (h, w))."""
    made = np.zeros((size, size, CHANNELS), np.float32)
    for name, value in (("direct", light), ("albedo", albedo), ("emission", glow), ("depth", depth)):
        made[..., PLANES[name]] = np.broadcast_to(np.asarray(value, np.float32), (size, size))[..., None]
    return made


def test_even_light_is_brought_to_a_share_of_the_albedo():
    assert metered(planes(0.2, albedo=0.5)) == pytest.approx(0.0, abs=0.03)
    assert metered(planes(0.8, albedo=0.5)) == pytest.approx(-2.0, abs=0.03)
    assert metered(planes(1e-6, albedo=0.2)) == pytest.approx(math.log2(0.08 / 1e-6), abs=0.03)


def test_light_of_any_strength_gives_the_same_picture():
    rng = np.random.default_rng(3)
    light = np.exp(rng.normal(size=(48, 48)))
    base = metered(planes(light))
    for stops in (-9, 3, 8):
        assert metered(planes(light * 2.0**stops)) == pytest.approx(base - stops, abs=0.051)


def test_light_in_one_spot_alone_is_metered():
    """Most of the picture is black, so that its brightest percent is not bright at all."""
    light = np.zeros((240, 240))
    light[:2, :2] = 1.0
    assert np.isfinite(metered(planes(light, size=240)))
    glow = np.zeros((240, 240))
    glow[0, 0] = 5.0
    assert np.isfinite(metered(planes(0.0, glow=glow, size=240)))


def test_dark_things_stay_darker_than_bright_ones():
    """Under the same light, irradiance π/2 everywhere, the same exposure."""
    assert metered(planes(0.35, albedo=0.7)) == pytest.approx(metered(planes(0.1, albedo=0.2)), abs=0.06)


def test_background_lamps_and_single_fireflies_do_not_count():
    light = np.full((48, 48), 0.2)
    plain = metered(planes(light))
    depth = np.ones((48, 48))
    depth[:20] = 0.0
    sky = np.where(depth > 0, 0.0, 50.0)
    assert metered(planes(np.where(depth > 0, light, 0.0), depth=depth, glow=sky)) == pytest.approx(plain, abs=0.01)
    lamp = np.zeros((48, 48))
    lamp[:6, :6] = 100.0
    assert metered(planes(light, glow=lamp)) == pytest.approx(plain, abs=0.01)
    firefly = light.copy()
    firefly[40, 40] = 1e4
    assert metered(planes(firefly)) == pytest.approx(plain, abs=0.06)


def test_noise_of_few_samples_does_not_darken():
    """A tenth of the pixels has ten times the light, the rest none: the mean is what counts."""
    rng = np.random.default_rng(1)
    noisy = np.where(rng.random((240, 240)) < 0.1, 2.0, 0.0)
    assert metered(planes(noisy, size=240)) == pytest.approx(metered(planes(0.2, size=240)), abs=0.15)


def test_highlights_hold_it_back():
    light = np.full((48, 48), 0.02)
    light[:, :8] = 5.0
    assert metered(planes(light)) < metered(planes(0.02)) - 1


def test_what_media_scatter_counts_as_what_surfaces_do():
    """A cloud in the middle of nothing, a quarter of the picture, becomes middle grey."""
    made = np.zeros((48, 48, MEDIA_CHANNELS), np.float32)
    made[12:36, 12:36, PLANES["volume"]] = 0.3
    made[12:36, 12:36, PLANES["volume indirect"]] = 0.42
    assert metered(made) == pytest.approx(math.log2(0.18 / 0.72), abs=0.03)


def test_a_picture_without_light_or_surface():
    assert metered(planes(0.0)) == 0.0
    only_sky = metered(planes(0.0, depth=0.0, albedo=0.0, glow=4.0))
    assert only_sky == pytest.approx(math.log2(0.18 / 4.0), abs=0.03)
    broken = planes(0.25)
    broken[5, 5, PLANES["direct"]] = np.nan
    assert math.isfinite(metered(broken))
