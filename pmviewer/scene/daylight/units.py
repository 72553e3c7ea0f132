"""Units of daylight, and its spectra as linear sRGB."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

CIE_Y = 106.7502593994140625
"""Integral of CIE's ȳ in nm, by which Mitsuba divides: a white of 1 W/(m² sr nm) has the luminance 1."""
KCD = 683 * CIE_Y / 1000
"""Luminance in kcd/m² of what counts as 1 here."""
RGB_OF_XYZ = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)
SUN_NM = np.arange(320, 721, 40)
_CIE_XYZ = np.array(
    [(0, 0, 0), (0.0001299, 0.000003917, 0.0006061), (0.01431, 0.000396, 0.06785), (0.34828, 0.023, 1.74706),
     (0.09564, 0.13902, 0.81295), (0.06327, 0.71, 0.07825), (0.5945, 0.995, 0.0039), (1.0622, 0.631, 0.0008),
     (0.4479, 0.175, 0.00002), (0.04677, 0.017, 0), (0.00579, 0.00209, 0)]
)  # fmt: skip
"""CIE 1931 2° observer at `SUN_NM`."""


def rgb_of_spectrum(spectrum: Float) -> Float:
    """Linear sRGB (3,) of values at `SUN_NM`."""
    return np.asarray(RGB_OF_XYZ @ (spectrum @ _CIE_XYZ)) * (SUN_NM[1] - SUN_NM[0]) / CIE_Y
