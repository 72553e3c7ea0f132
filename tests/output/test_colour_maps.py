"""Tables of false colours as everybody sees them, the colour-blind too; ranges; histograms."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from pmviewer.output.colour_maps import CLASSES, FATES, SEQUENTIAL, TWO_SIDED
from pmviewer.output.diagnostic_views import DIAGNOSTICS, coloured, view_scale
from pmviewer.output.false_look import Look, Own, histogram
from pmviewer.output.falsecolour import Scale
from pmviewer.output.marks import CUT, radiance_marks
from pmviewer.output.tone import MAGENTA, tone_map
from pmviewer.settings.access import SETTINGS

# Machado, Oliveira, Fernandes, "A Physiologically-based Model for Simulation of Color Vision Deficiency" (2009),
# severity 1, for linear sRGB.
EYES = {
    "usual": np.eye(3),
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}


def cielab(colours, eye):
    """CIE L*a*b* (D65) of display-encoded colours (n, 3) as that eye sees them."""
    srgb = np.asarray(colours, np.float64)
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    linear = np.clip(linear @ np.asarray(EYES[eye]).T, 0, 1)
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    x, y, z = (linear @ to_xyz.T / (0.9505, 1.0, 1.089)).T
    fx, fy, fz = (np.where(v > 0.008856, np.cbrt(v), 7.787 * v + 16 / 116) for v in (x, y, z))
    return np.stack([116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)], 1)


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize("name", SEQUENTIAL)
def test_lightness_alone_tells_the_order(name, eye):
    lightness = cielab(SEQUENTIAL[name][::8], eye)[:, 0]
    assert np.diff(lightness).min() > 0.4
    assert lightness[-1] - lightness[0] > 70


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize("name", TWO_SIDED)
def test_both_sides_of_a_middle_darken_and_differ(name, eye):
    lab = cielab(TWO_SIDED[name], eye)
    below, above = lab[127::-8], lab[128::8]
    assert np.diff(below[:, 0]).max() < 0
    assert np.diff(above[:, 0]).max() < 0
    if (name, eye) != ("purple-green", "tritan"):  # who confuses blue and green has blue-orange
        apart = np.linalg.norm(below[6:, 1:] - above[6:, 1:], axis=1)
        assert apart.min() > 15


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize("palette", [CLASSES["colour-blind safe"], FATES["colour-blind safe"]])
def test_safe_classes_differ_for_every_eye(palette, eye):
    lab = cielab(palette, eye)
    assert min(np.linalg.norm(a - b) for a, b in itertools.combinations(lab, 2)) > 20


def test_no_table_has_the_warning_colour_or_leaves_the_screen():
    for table in (*SEQUENTIAL.values(), *TWO_SIDED.values()):
        assert table.shape == (256, 3)
        assert table.min() >= 0
        assert table.max() <= 1
        assert np.abs(table - MAGENTA).max(axis=1).min() > 0.3
        assert np.abs(np.diff(table, axis=0)).max() < 0.03


def test_settings_name_the_tables():
    assert SETTINGS["display.colours"].choices == tuple(SEQUENTIAL)
    assert SETTINGS["display.two_sided"].choices == tuple(TWO_SIDED)
    assert SETTINGS["display.classes"].choices == tuple(CLASSES) == tuple(FATES)


VALUES = np.arange(1.0, 1001.0)


@pytest.mark.parametrize(
    ("look", "own", "ends"),
    [
        (Look(), Own(), (10.99, 990.01)),
        (Look(range="percentiles", percentile=10.0), Own(), (100.9, 900.1)),
        (Look(range="percentiles", percentile=0.0), Own(log=True), (1.0, 1000.0)),
        (Look(range="by hand", low=5.0, high=2.0), Own(), (2.0, 5.0)),
        (Look(range="by hand", low=0.0, high=2.0, spacing="log"), Own(), (2e-6, 2.0)),
        (Look(range="by hand", low=3.0, high=3.0), Own(), (1.5, 4.5)),
        (Look(), Own(fixed=(0.0, 100.0)), (0.0, 100.0)),
        (Look(range="percentiles"), Own(fixed=(0.0, 100.0)), (10.99, 990.01)),
        (Look(), Own(signed=True), (-990.01, 990.01)),
        (Look(), Own(from_none=True), (0.0, 990.01)),
    ],
)
def test_ranges_by_the_settings(look, own, ends):
    scale = look.scale(own, VALUES)
    assert (scale.lower, scale.upper) == pytest.approx(ends)


@pytest.mark.parametrize(("spacing", "own", "log"), [
    ("auto", Own(log=True), True), ("auto", Own(), False), ("log", Own(), True), ("linear", Own(log=True), False),
    ("log", Own(signed=True), False),
])  # fmt: skip
def test_spacing_by_the_settings(spacing, own, log):
    assert Look(spacing=spacing).scale(own, VALUES).log is log


def test_a_logarithm_of_nothing_is_shown_evenly():
    scale = Look(range="by hand", low=-2.0, high=-1.0, spacing="log").scale(Own(), VALUES)
    assert (scale.lower, scale.upper, scale.log) == (-2.0, -1.0, False)


def test_histograms_count_every_value_once():
    values = np.array([-1.0, 0.0, 0.5, 9.99, 10.0, 11.0, np.nan, np.inf])
    counts = histogram(values, Scale(0.0, 10.0), bins=10)
    assert counts.counts.tolist() == [2, 0, 0, 0, 0, 0, 0, 0, 0, 2]
    assert (counts.below, counts.above, counts.broken, counts.total) == (1, 1, 2, 6)
    decades = histogram(np.array([0.0, 1.0, 9.0, 10.0, 99.0, 100.0]), Scale(1.0, 100.0, log=True), bins=2)
    assert decades.counts.tolist() == [2, 3]
    assert decades.below == 1


def test_views_follow_the_look():
    plane = np.array([[[1.0], [10.0], [100.0], [-1.0]]], np.float32)
    look = Look(colours="grey", range="by hand", low=1.0, high=100.0, spacing="log")
    assert view_scale("look-up radius", plane, look) == Scale(1.0, 100.0, True, "m")
    pixels = coloured("look-up radius", plane, look)
    np.testing.assert_allclose(pixels[0, :3], SEQUENTIAL["grey"][[0, 128, 255]], atol=1e-6)
    assert DIAGNOSTICS["caustic convergence"].classes
    classes = coloured("caustic convergence", np.array([[[0.0], [2.0]]], np.float32), Look(classes="colour-blind safe"))
    np.testing.assert_allclose(classes[0], np.array(CLASSES["colour-blind safe"])[[0, 2]], atol=1e-6)


@pytest.mark.parametrize("curve", CUT)
def test_clipped_is_what_the_curve_shows_as_white(curve):
    cut = min(CUT[curve], 1e3)
    just, below = (tone_map(np.full((1, 1, 3), value), 0.0, curve).min() for value in (1.0001 * cut, 0.98 * cut))
    white = 1 - 1e-6  # the encoding of 1 is a rounding below it
    assert (just > white) == (curve != "Reinhard")
    assert below < white


def test_odd_pixels_are_counted_by_what_is_odd():
    image = np.full((2, 4, 3), 0.4, np.float32)
    image[0, 0, 1], image[0, 1, 2], image[0, 2, 0], image[1, 3, 1] = np.nan, -0.1, 0.6, np.inf
    marks = radiance_marks(image, 0.0, "sRGB")
    assert (marks.broken, marks.negative, marks.clipped, marks.total) == (2, 1, 0, 8)
    assert radiance_marks(image, 1.0, "sRGB").clipped == 1
    assert radiance_marks(image, 1.0, "Reinhard").clipped == 0
