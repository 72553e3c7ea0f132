"""Preetham, Shirley and Smits, "A Practical Analytic Model for Daylight" (1999): sky and sun of few numbers."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.daylight.units import KCD, RGB_OF_XYZ, SUN_NM, rgb_of_spectrum

Float = NDArray[np.float64]

_PEREZ = {
    "Y": ((0.1787, -1.4630), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771), (-0.0670, 0.3703)),
    "x": ((-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989), (-0.0033, 0.0452)),
    "y": ((-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537), (-0.0109, 0.0529)),
}
_ZENITH = {
    "x": (
        (0.00166, -0.00375, 0.00209, 0.0), (-0.02903, 0.06377, -0.03202, 0.00394),
        (0.11693, -0.21196, 0.06052, 0.25886),
    ),
    "y": (
        (0.00275, -0.00610, 0.00317, 0.0), (-0.04214, 0.08970, -0.04153, 0.00516),
        (0.15346, -0.26756, 0.06670, 0.26688),
    ),
}  # fmt: skip
_OUTSIDE_AIR = np.array([0.82, 1.07, 1.69, 1.83, 2.07, 1.85, 1.80, 1.75, 1.61, 1.47, 1.36])
"""W/(m² nm) at `SUN_NM`."""
_OZONE = np.array([0.8, 0.0, 0.0, 0.003, 0.014, 0.048, 0.103, 0.125, 0.079, 0.036, 0.014])
"""Absorption per cm of ozone at `SUN_NM`."""


class Preetham:
    """Sky of Perez' form with coefficients linear in turbidity; the sun behind air, aerosol and ozone."""

    def __init__(self, turbidity: float, zenith: float) -> None:
        self.turbidity = max(turbidity, 2.0)  # below, the fit has negative radiances
        self.zenith = min(zenith, math.pi / 2 - 0.01)

    def _perez(self, quantity: str, cos: Float, gamma: Float) -> Float:
        a, b, c, d, e = (slope * self.turbidity + base for slope, base in _PEREZ[quantity])
        return np.asarray((1 + a * np.exp(b / (cos + 0.01))) * (1 + c * np.exp(d * gamma) + e * np.cos(gamma) ** 2))

    def radiance(self, cos_zenith: Float, gamma: Float) -> Float:
        """(…, 3) linear RGB of the sky in directions with these cosines to the zenith and angles `gamma` to the sun in
        radians."""
        t, sun = self.turbidity, self.zenith
        chi = (4 / 9 - t / 120) * (math.pi - 2 * sun)
        bright = (4.0453 * t - 4.9710) * math.tan(chi) - 0.2155 * t + 2.4192
        at_zenith = {"Y": bright / KCD}
        for quantity, rows in _ZENITH.items():
            at_zenith[quantity] = sum(t ** (2 - i) * float(np.polyval(row, sun)) for i, row in enumerate(rows))
        cos = np.maximum(cos_zenith, 0.0)
        overhead, beside = np.ones(()), np.array(sun)
        value = {
            q: at_zenith[q] * self._perez(q, cos, gamma) / self._perez(q, overhead, beside) for q in ("Y", "x", "y")
        }
        luminance, x, y = np.maximum(value["Y"], 0.0), value["x"], np.maximum(value["y"], 1e-3)
        xyz = np.stack([x / y * luminance, luminance, (1 - x - y) / y * luminance], axis=-1)
        return np.maximum(xyz @ RGB_OF_XYZ.T, 0.0)

    def sun(self) -> Float:
        """Irradiance (3,) on a plane that faces the sun: what the air lets through of the light outside it."""
        nm = SUN_NM / 1000
        beyond = 93.885 - math.degrees(self.zenith)
        mass = 1 / (math.cos(self.zenith) + 0.15 * max(beyond, 1.0) ** -1.253)
        aerosol = 0.04608365822 * self.turbidity - 0.04586025928
        depth = 0.008735 * nm**-4.08 + aerosol * nm**-1.3 + 0.35 * _OZONE
        return np.maximum(rgb_of_spectrum(_OUTSIDE_AIR * np.exp(-mass * depth)), 0.0)
