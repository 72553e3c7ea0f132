"""False colours keep the order of values; scales and ticks are where they should be."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmviewer.output.falsecolour import COLOURS, Scale, false_colour, scale_around_one, scale_of
from pmviewer.output.tone import MAGENTA


def lightness(srgb: np.ndarray) -> np.ndarray:
    """CIE L* of display-encoded colours (n, 3)."""
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    y = linear @ np.array([0.2126, 0.7152, 0.0722])
    return np.where(y > 0.008856, 116 * np.cbrt(y) - 16, 903.3 * y)


def test_lightness_rises_evenly():
    steps = np.diff(lightness(COLOURS.astype(np.float64)))
    assert steps.min() > 0
    assert steps.max() < 2 * steps.mean()
    assert COLOURS.min() > 0  # inside the gamut: nothing had to be cut
    assert COLOURS.max() < 1


def test_neighbouring_colours_differ_little_and_none_is_the_warning_colour():
    assert np.abs(np.diff(COLOURS, axis=0)).max() < 0.03
    assert np.abs(COLOURS - MAGENTA).max(axis=1).min() > 0.3


def test_linear_and_logarithmic_positions():
    np.testing.assert_allclose(Scale(2, 6).normalise(np.array([1, 2, 3, 6, 9])), [0, 0, 0.25, 1, 1])
    log = Scale(1e-2, 1e2, log=True)
    np.testing.assert_allclose(log.normalise(np.array([-1, 0, 1e-3, 1e-2, 1, 10, 1e2])), [0, 0, 0, 0, 0.5, 0.75, 1])


@pytest.mark.parametrize(("low", "high", "log"), [(1, 1, False), (2, 1, False), (0, 1, True), (0, math.inf, False)])
def test_impossible_scales_are_refused(low, high, log):
    with pytest.raises(ValueError, match="no scale from"):
        Scale(low, high, log)


def test_ticks_are_round_and_carry_the_unit():
    assert [t.label for t in Scale(0, 1, unit="m").ticks()] == ["0 m", "0.5 m", "1 m"]
    assert [t.label for t in Scale(3, 41).ticks()] == ["10", "20", "30", "40"]
    decades = Scale(0.002, 3e4, log=True, unit="photons/m²").ticks(8)
    assert [t.label.split()[0] for t in decades] == ["0.01", "0.1", "1", "10", "100", "1000", "10000"]
    assert [t.label for t in Scale(1, 30, log=True).ticks()] == ["1", "2", "5", "10", "20"]
    around_one = scale_around_one(np.array([0.002, 1.0, 3.0]), unit="×").ticks()
    assert [t.label for t in around_one if t.position == pytest.approx(0.5)] == ["1 ×"]
    assert decades[0].position == pytest.approx(math.log(5) / math.log(1.5e7))


@given(st.floats(-1e6, 1e6), st.floats(1e-3, 1e6), st.booleans())
def test_every_scale_has_ticks_inside(low, span, log):
    low = abs(low) + 1e-3 if log else low
    scale = Scale(low, low + span, log)
    ticks = scale.ticks()
    assert 1 <= len(ticks) <= 12
    assert [t.position for t in ticks] == sorted(t.position for t in ticks)
    for tick in ticks:
        assert float(tick.label) == pytest.approx(tick_value(scale, tick.position), rel=1e-4, abs=1e-4 * span)


def tick_value(scale: Scale, position: float) -> float:
    if scale.log:
        return scale.lower * (scale.upper / scale.lower) ** position
    return scale.lower + position * (scale.upper - scale.lower)


def test_scale_follows_the_bulk_of_the_values():
    values = np.concatenate([np.linspace(1, 2, 10_000), [1e9, math.nan, math.inf]])
    scale = scale_of(values, unit="m")
    assert scale.lower == pytest.approx(1.01, abs=1e-3)
    assert scale.upper == pytest.approx(1.99, abs=1e-3)
    assert scale.unit == "m"


@pytest.mark.parametrize("log", [False, True])
@pytest.mark.parametrize("values", [[], [math.nan], [0.0, 0.0], [3.0], [-2.0, -2.0], [1e-30]])
def test_a_scale_is_found_for_anything(values, log):
    scale = scale_of(np.array(values), log)
    good = [v for v in values if math.isfinite(v) and (v > 0 or not log)]
    assert all(scale.lower <= v <= scale.upper for v in good)


def test_picture_shows_order_and_marks_what_is_no_number():
    values = np.array([[0.0, 0.5, 1.0], [math.nan, math.inf, -5.0]], np.float32)
    pixels = false_colour(values[..., None], Scale(0, 1))
    np.testing.assert_array_equal(pixels[0], COLOURS[[0, 128, 255]])
    np.testing.assert_array_equal(pixels[1], [MAGENTA, MAGENTA, COLOURS[0]])
