"""Tone curves against their formulas in plain Python, and how views are shown."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pmviewer.output.tone import MAGENTA, display_image, to_uint8, tone_map


def encode(x: float) -> float:
    return 12.92 * x if x <= 0.0031308 else 1.055 * x ** (1 / 2.4) - 0.055


def naive(x: float, exposure: float, curve: str) -> float:
    x = max(x, 0.0) * 2**exposure
    if curve == "Reinhard":
        x = x / (1 + x)
    if curve == "filmic":
        x = (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14)
    x = min(x, 1.0)
    return x if curve == "linear" else encode(x)


@pytest.mark.parametrize("curve", ["sRGB", "Reinhard", "filmic", "linear"])
@pytest.mark.parametrize("exposure", [-3.0, 0.0, 1.5])
def test_curve_is_its_formula(curve, exposure):
    values = np.array([-1.0, 0.0, 1e-4, 0.003, 0.0032, 0.18, 0.5, 0.999, 1.0, 2.0, 50.0, 1e6], np.float32)
    image = np.stack([values, values[::-1], values], axis=-1)[None]
    got = tone_map(image, exposure, curve)
    expected = np.vectorize(lambda v: naive(float(v), exposure, curve))(image)
    assert got.dtype == np.float32
    assert got.shape == (1, 12, 3)
    np.testing.assert_allclose(got, expected, atol=2e-6)
    assert got.min() >= 0
    assert got.max() <= 1


@pytest.mark.parametrize("curve", ["sRGB", "Reinhard", "filmic", "linear"])
def test_extreme_radiance_is_black_or_white(curve):
    values = np.array([[math.inf, 3e38, 1e30, -math.inf, math.nan]], np.float32)
    got = tone_map(values, 20.0, curve)
    np.testing.assert_allclose(got[0, :, 0], [1, 1, 1, 0, 0], atol=1e-6)


def test_one_channel_becomes_grey():
    got = tone_map(np.full((2, 3, 1), 0.25, np.float32), 0.0, "linear")
    np.testing.assert_array_equal(got, np.full((2, 3, 3), 0.25, np.float32))


def test_wrong_shape_is_refused():
    with pytest.raises(ValueError, match=r"\(2, 2, 4\)"):
        tone_map(np.zeros((2, 2, 4), np.float32), 0.0, "linear")


def test_rounding_is_half_up():
    steps = np.arange(256, dtype=np.float32)
    np.testing.assert_array_equal(to_uint8(steps / 255), steps.astype(np.uint8))
    np.testing.assert_array_equal(to_uint8(np.array([-1, 0.5 / 255, 0.4999 / 255, 2], np.float32)), [0, 1, 0, 255])


def test_tone_mapping_leaves_its_input_alone():
    image = np.full((2, 2, 3), np.nan, np.float32)
    display_image("beauty", image)
    assert np.isnan(image).all()


@pytest.mark.parametrize("view", ["beauty", "direct", "albedo", "normal", "depth"])
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_broken_pixels_are_magenta_and_spoil_no_other(view, bad):
    channels = 1 if view == "depth" else 3
    image = np.linspace(0.1, 0.9, 4 * channels, dtype=np.float32).reshape(2, 2, channels)
    whole = display_image(view, image).pixels
    image[0, 1, 0] = bad
    shown = display_image(view, image).pixels
    np.testing.assert_array_equal(shown[0, 1], MAGENTA)
    if view == "depth":
        assert shown[0, 0, 0] > shown[1, 0, 0] > shown[1, 1, 0] > 0
    else:
        np.testing.assert_array_equal(shown[[0, 1, 1], [0, 0, 1]], whole[[0, 1, 1], [0, 0, 1]])


def test_normals_are_shown_shifted_and_nothing_as_black():
    normals = np.array([[[0, 0, 1], [-1, 0, 0], [0, 0, 0]]], np.float32)
    shown = display_image("normal", normals, 3.0)
    np.testing.assert_array_equal(shown.pixels, [[[0.5, 0.5, 1], [0, 0.5, 0.5], [0, 0, 0]]])
    assert shown.bounds is None


def test_depth_is_normalised_near_is_bright():
    shown = display_image("depth", np.array([[[2.0], [4.0], [3.0], [0.0]]], np.float32), 5.0)
    assert shown.bounds == (2.0, 4.0)
    np.testing.assert_allclose(shown.pixels[0, :, 1], [1.0, 0.1, 0.55, 0.0], atol=1e-6)


def test_depth_of_an_empty_picture_is_black():
    shown = display_image("depth", np.zeros((2, 2, 1), np.float32))
    assert shown.bounds == (0.0, 1.0)
    assert not shown.pixels.any()


def test_albedo_ignores_exposure():
    albedo = np.full((1, 1, 3), 0.5, np.float32)
    np.testing.assert_allclose(display_image("albedo", albedo, 4.0, "Reinhard").pixels, encode(0.5), atol=1e-6)
