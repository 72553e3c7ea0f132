"""Shading under false colours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from pmviewer.output.shading import DARKEST, shaded, shades


@dataclass(frozen=True)
class Eye:
    origin: tuple[float, float, float] = (0.0, 0.0, 7.0)
    target: tuple[float, float, float] = (0.0, 0.0, 2.0)


def test_surfaces_are_as_bright_as_they_face_the_camera():
    normals = np.array([[[0, 0, 1], [0, 0, -1], [1, 0, 0], [0.6, 0, 0.8], [0, 0, 0], [np.nan, 0, 0]]], np.float32)
    values = shades(normals, Eye())[0]
    expected = [1, 1, DARKEST, DARKEST + 0.8 * (1 - DARKEST), 1, 1]
    np.testing.assert_allclose(values, expected, atol=1e-6)


def test_its_strength_is_between_the_plain_colour_and_the_whole_shade():
    pixels, shade = np.full((1, 1, 3), 0.5, np.float32), np.array([[0.4]], np.float32)
    for strength, factor in ((0.0, 1.0), (0.5, 0.7), (1.0, 0.4)):
        assert shaded(pixels, shade, strength) == pytest.approx(0.5 * factor)
