"""Tables of false colours, made in Oklab so that lightness alone tells the order: in grey print, and for colour-blind
eyes, too (a test looks at them as such eyes do)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pmviewer.output.tone import srgb_encode

SIZE = 256
RGB = tuple[float, float, float]
_OKLAB_TO_LMS = np.array(
    [
        [1.0, 0.3963377774, 0.2158037573],
        [1.0, -0.1055613458, -0.0638541728],
        [1.0, -0.0894841775, -1.2914855480],
    ]
)
_LMS_TO_RGB = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)
_HALVINGS = 14
"""After which a chroma is known at which a colour is one of the screen's."""

F8 = NDArray[np.float64]


def _oklab_to_rgb(lab: F8) -> F8:
    """Oklab (n, 3) to linear sRGB (B. Ottosson, "A perceptual color space for image processing", 2020)."""
    return (lab @ _OKLAB_TO_LMS.T) ** 3 @ _LMS_TO_RGB.T


def _linear(lightness: F8, chroma: F8, angle: F8) -> F8:
    return _oklab_to_rgb(np.stack([lightness, chroma * np.cos(angle), chroma * np.sin(angle)], 1))


def _encoded(lightness: F8, chroma: F8, hue: F8) -> NDArray[np.float32]:
    """Display-encoded (n, 3) of Oklab in polar coordinates, `hue` in degrees. Where the screen has no such colour its
    chroma is lowered: lightness and hue stay."""
    angle = np.radians(hue)
    inside, outside = np.zeros(len(lightness)), np.full(len(lightness), 2.0)
    for share in (np.ones(len(lightness)), *[None] * _HALVINGS):
        share = 0.5 * (inside + outside) if share is None else share
        rgb = _linear(lightness, share * chroma, angle)
        good = ((rgb >= 0) & (rgb <= 1)).all(axis=1)
        inside, outside = np.where(good, share, inside), np.where(good, outside, share)
        outside = np.where(inside >= 1, 1.0, outside)
    kept = _linear(lightness, inside * chroma, angle)
    return srgb_encode(kept.astype(np.float32))


def _violet_yellow() -> NDArray[np.float32]:
    """The hue turns from violet over blue and green to yellow. Chroma is lowest in the middle, where the screen's
    gamut is narrowest."""
    t = np.linspace(0.0, 1.0, SIZE)
    d = t - 0.45
    return _encoded(0.22 + 0.72 * t, 0.085 + np.where(d < 0, 0.1, 0.28) * d**2, 305.0 - 200.0 * t)


def _fire() -> NDArray[np.float32]:
    """Nearly black over red and orange to a pale yellow."""
    t = np.linspace(0.0, 1.0, SIZE)
    return _encoded(0.14 + 0.83 * t, 0.14 * np.sin(np.pi * (0.08 + 0.84 * t)), 18.0 + 78.0 * t)


def _blue_yellow() -> NDArray[np.float32]:
    """Dark blue over grey to yellow: the axis that red-green blindness leaves."""
    t = np.linspace(0.0, 1.0, SIZE)
    return _encoded(0.20 + 0.74 * t, 0.20 * np.abs(t - 0.45), np.where(t < 0.45, 262.0, 98.0))


def _grey() -> NDArray[np.float32]:
    t = np.linspace(0.0, 1.0, SIZE)
    return _encoded(0.18 + 0.79 * t, np.zeros(SIZE), np.zeros(SIZE))


def _two_sided(low: float, high: float) -> NDArray[np.float32]:
    """From one hue over a light grey to another: lightness falls evenly from the middle to both ends."""
    t = np.linspace(-1.0, 1.0, SIZE)
    off = np.abs(t)
    return _encoded(
        0.93 - 0.48 * off, 0.13 * np.sin(0.5 * np.pi * np.minimum(1.6 * off, 1.0)), np.where(t < 0, low, high)
    )


SEQUENTIAL: Mapping[str, NDArray[np.float32]] = {
    "violet-yellow": _violet_yellow(),
    "fire": _fire(),
    "blue-yellow": _blue_yellow(),
    "grey": _grey(),
}
"""(256, 3) by name, display-encoded, dark to light."""
TWO_SIDED: Mapping[str, NDArray[np.float32]] = {
    "blue-orange": _two_sided(255.0, 55.0),
    "purple-green": _two_sided(310.0, 145.0),
}
"""(256, 3) by name, display-encoded: below, at and above a middle that matters."""

CLASSES: Mapping[str, tuple[RGB, ...]] = {
    "usual": ((0.86, 0.27, 0.22), (0.35, 0.74, 0.36), (0.27, 0.48, 0.9)),
    "colour-blind safe": ((0.84, 0.37, 0.0), (0.94, 0.89, 0.26), (0.16, 0.45, 0.80)),
}
"""Display-encoded, of the caustic convergence: red, green, blue as in Suykens and Willems' figure 6, or vermilion,
yellow, blue (after Okabe and Ito)."""
FATES: Mapping[str, tuple[RGB, ...]] = {
    "usual": ((0.45, 0.85, 0.40), (0.90, 0.35, 0.30), (0.35, 0.60, 0.98), (0.98, 0.85, 0.25)),
    "colour-blind safe": ((0.16, 0.45, 0.80), (0.84, 0.37, 0.0), (0.55, 0.80, 0.97), (0.94, 0.89, 0.26)),
}
"""Display-encoded, of photons that are stored, rejected, redistributed and discarded."""
