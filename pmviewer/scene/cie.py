"""From spectra to linear sRGB, as Mitsuba 3 converts them for its RGB variants.

The colour matching functions of the CIE 1931 standard observer (2°) and the standard illuminant D65 from 360 to 830 nm
in steps of 5 nm are those of the CIE (publication 15); between them they are interpolated linearly. A spectrum counts
as zero outside the wavelengths that it is given at.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.description import RGB

FIRST_NM, LAST_NM = 360.0, 830.0

_OBSERVER = (
    """
    .0001299 .0002321 .0004149 .0007416 .001368 .002236 .004243 .00765 .01431 .02319 .04351 .07763 .13438 .21477
    .2839 .3285 .34828 .34806 .3362 .3187 .2908 .2511 .19536 .1421 .09564 .05795 .03201 .0147 .0049 .0024 .0093
    .0291 .06327 .1096 .1655 .2257499 .2904 .3597 .4334499 .5120501 .5945 .6784 .7621 .8425 .9163 .9786 1.0263
    1.0567 1.0622 1.0456 1.0026 .9384 .8544499 .7514 .6424 .5419 .4479 .3608 .2835 .2187 .1649 .1212 .0874 .0636
    .04677 .0329 .0227 .01584 .0113592 .0081109 .0057903 .0041095 .0028993 .0020492 .00144 .0009999 .0006901 .000476
    .0003323 .0002348 .0001662 .0001174 .0000831 .0000587 .0000415 .0000294 .0000207 .0000146 .0000103 .0000072
    .0000051 .0000036 .0000025 .0000018 .0000013
    """,
    """
    .0000039 .000007 .0000124 .000022 .000039 .000064 .00012 .000217 .000396 .00064 .00121 .00218 .004 .0073 .0116
    .01684 .023 .0298 .038 .048 .06 .0739 .09098 .1126 .13902 .1693 .20802 .2586 .323 .4073 .503 .6082 .71 .7932
    .862 .9148501 .954 .9803 .9949501 1 .995 .9786 .952 .9154 .87 .8163 .757 .6949 .631 .5668 .503 .4412 .381 .321
    .265 .217 .175 .1382 .107 .0816 .061 .04458 .032 .0232 .017 .01192 .00821 .005723 .004102 .002929 .002091
    .001484 .001047 .00074 .00052 .0003611 .0002492 .0001719 .00012 .0000848 .00006 .0000424 .00003 .0000212 .000015
    .0000106 .0000075 .0000053 .0000037 .0000026 .0000018 .0000013 .0000009 .0000006 .0000005
    """,
    """
    .0006061 .001086 .001946 .003486 .00645 .01055 .02005 .03621 .06785 .1102 .2074 .3713 .6456 1.0390501 1.3856
    1.62296 1.74706 1.7826 1.77211 1.7441 1.6692 1.5281 1.28764 1.0419 .8129501 .6162 .46518 .3533 .272 .2123 .1582
    .1117 .07825 .05725 .04216 .02984 .0203 .0134 .00875 .00575 .0039 .00275 .0021 .0018 .00165 .0014 .0011 .001
    .0008 .0006 .00034 .00024 .00019 .0001 .00005 .00003 .00002 .00001 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0
    0 0 0 0 0 0 0 0 0 0 0 0 0 0
    """,
)
_D65 = """
    46.6383 49.3637 52.0891 51.0323 49.9755 52.3118 54.6482 68.7015 82.7549 87.1204 91.486 92.4589 93.4318 90.057
    86.6823 95.7736 104.865 110.936 117.008 117.41 117.812 116.336 114.861 115.392 115.923 112.367 108.811 109.082
    109.354 108.578 107.802 106.296 104.79 106.239 107.689 106.047 104.405 104.225 104.046 102.023 100 98.1671
    96.3342 96.0611 95.788 92.2368 88.6856 89.3459 90.0062 89.8026 89.5991 88.6489 87.6987 85.4936 83.2886 83.4939
    83.6992 81.863 80.0268 80.1207 80.2146 81.2462 82.2778 80.281 78.2842 74.0027 69.7213 70.6652 71.6091 72.979
    74.349 67.9765 61.604 65.7448 69.8856 72.4863 75.087 69.3398 63.5927 55.0054 46.4182 56.6118 66.8054 65.0941
    63.3828 63.8434 64.304 61.8779 59.4519 55.7054 51.959 54.6998 57.4406 58.8765 60.3125
    """
_XYZ_TO_SRGB = np.array(
    [[3.240479, -1.537150, -0.498535], [-0.969256, 1.875991, 0.041556], [0.055648, -0.204043, 1.057311]]
)
"""Primaries and white of ITU-R BT.709."""
_SAMPLES = 1000

EQUAL_ENERGY: RGB = (1.204794, 0.948291, 0.908916)
"""The colour of light whose spectrum is 1 everywhere: a little pink, since white in sRGB is daylight."""


def _sampled(text: str, wavelengths: NDArray[np.float64]) -> NDArray[np.float64]:
    table = np.array(text.split(), np.float64)
    return np.interp(wavelengths, np.linspace(FIRST_NM, LAST_NM, len(table)), table)


_WAVELENGTHS = np.linspace(FIRST_NM, LAST_NM, _SAMPLES)
_MATCHING = np.stack([_sampled(text, _WAVELENGTHS) for text in _OBSERVER])
_DAYLIGHT = _sampled(_D65, _WAVELENGTHS)
# A unit spectrum, and daylight on a white surface, have luminance 1.
_MATCHING /= _MATCHING[1].mean()
_DAYLIGHT /= (_MATCHING[1] * _DAYLIGHT).mean()


def colours_in_daylight(nm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear sRGB (n, 3), possibly negative, of daylight (D65) of single wavelengths; white if all are added up."""
    matching, daylight = (
        np.stack([np.interp(nm, _WAVELENGTHS, row) for row in rows]) for rows in (_MATCHING, [_DAYLIGHT])
    )
    return (_XYZ_TO_SRGB @ (matching * daylight)).T


def integrated(spectrum: Callable[[NDArray[np.float64]], NDArray[np.float64]], lit: bool) -> RGB:
    """Linear sRGB, possibly negative, of a spectrum over wavelengths in nm. `lit`: it is what a surface makes of
    daylight (D65), not light itself; a surface of reflectance 1 is then white."""
    values = spectrum(_WAVELENGTHS)
    if lit:
        values = values * _DAYLIGHT
    r, g, b = (_XYZ_TO_SRGB @ (_MATCHING * values).mean(axis=1)).tolist()
    return (r, g, b)


def rgb_of_samples(wavelengths: Sequence[float], values: Sequence[float], lit: bool) -> RGB:
    """Linear sRGB of values at increasing wavelengths in nm, joined by straight lines."""
    return integrated(lambda nm: np.interp(nm, wavelengths, values, left=0.0, right=0.0), lit)


def rgb_of_blackbody(kelvin: float, first: float = FIRST_NM, last: float = LAST_NM) -> RGB:
    """Linear sRGB of a black body's radiance in W/(m² sr nm) between two wavelengths in nm (Planck's law)."""
    c, h, k = 2.99792458e8, 6.62607015e-34, 1.380649e-23

    def radiance(nm: NDArray[np.float64]) -> NDArray[np.float64]:
        metres = nm * 1e-9
        with np.errstate(over="ignore"):
            planck = 2e-9 * h * c * c / (metres**5 * np.expm1(h * c / (k * metres * kelvin)))
        return np.where((nm >= first) & (nm <= last), planck, 0.0)

    return integrated(radiance, lit=False)
