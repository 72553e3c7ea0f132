"""Radiance of a clear sky and irradiance of the sun, in the units of Mitsuba 3's `sunsky`: W/(m² sr nm) and W/(m² nm)
weighted with CIE's ȳ and divided by its integral.

Hosek and Wilkie's model ("An Analytic Model for Full Spectral Sky-Dome Radiance", 2012, and for the sun 2013) is what
Mitsuba has; its tables come with Mitsuba's package. Where that is not installed, `preetham` stands in.
"""

from __future__ import annotations

import importlib.metadata
import math
import struct
from functools import cache
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.daylight.preetham import Preetham
from pmviewer.scene.daylight.units import CIE_Y, rgb_of_spectrum

Float = NDArray[np.float64]
Colour = tuple[float, float, float]

SUN_HALF_APERTURE = math.radians(0.5358 / 2)


_SUN_FACTOR = 467.069280386 / 440
"""Mitsuba's constant for the sun's colours, over the 440 nm that its eleven values stand for."""


class SkyModel(Protocol):
    """A sky for one place of the sun."""

    def radiance(self, cos_zenith: Float, gamma: Float) -> Float:
        """(…, 3) towards directions above the horizon, `gamma` radians from the sun; not negative."""

    def sun(self) -> Float:
        """(3,): irradiance on what faces the sun."""


def sky_model(turbidity: float, albedo: Colour, zenith: float) -> tuple[SkyModel, bool]:
    """The sky of a turbidity (1 to 10) over ground of an albedo, with the sun at this angle to the zenith, and whether
    it is Mitsuba's own model."""
    tables = _mitsuba_tables()
    if tables is None:
        return Preetham(turbidity, zenith), False
    return HosekWilkie(tables, turbidity, albedo, zenith), True


class HosekWilkie:
    """Tables: turbidity 1 to 10, albedo 0 and 1, six control points over the sun's elevation (quintic Bézier curves in
    its cube root), channel, and for the shape of the sky nine coefficients."""

    def __init__(self, tables: dict[str, Float], turbidity: float, albedo: Colour, zenith: float) -> None:
        elevation = max(math.pi / 2 - zenith, 0.0)
        x = min((2 / math.pi * elevation) ** (1 / 3), 1.0)
        curve = np.array([math.comb(5, i) * x**i * (1 - x) ** (5 - i) for i in range(6)])
        share = np.array(albedo)[:, None]

        def at(name: str) -> Float:
            values = _between(tables[name], turbidity - 1)
            values = values.reshape(2, 6, 3, -1)
            mixed = values[0] * (1 - share) + values[1] * share
            return np.asarray(np.tensordot(curve, mixed, 1))

        self._shape, self._scale = at("sky_params_rgb"), at("sky_rad_rgb")[:, 0]
        degrees = (math.degrees(elevation) - 2) / 3
        self._sun = _between(_between(tables["sun_irradiance"], turbidity - 1), degrees)

    def radiance(self, cos_zenith: Float, gamma: Float) -> Float:
        """(…, 3) of the sky in directions with these cosines to the zenith (below 0: the horizon's) and angles `gamma`
        to the sun in radians."""
        a, b, c, d, e, f, g, i, h = (self._shape[:, k] for k in range(9))
        cos, gamma = np.maximum(cos_zenith, 0.0)[..., None], gamma[..., None]
        cos_gamma = np.cos(gamma)
        chi = (1 + cos_gamma**2) / (1 + h**2 - 2 * h * cos_gamma) ** 1.5
        shape = (1 + a * np.exp(b / (cos + 0.01))) * (
            c + d * np.exp(e * gamma) + f * cos_gamma**2 + g * chi + i * np.sqrt(cos)
        )
        return np.maximum(shape * self._scale / CIE_Y, 0.0)

    def sun(self) -> Float:
        """Irradiance (3,) on a plane that faces the sun."""
        return np.maximum(_SUN_FACTOR * rgb_of_spectrum(self._sun), 0.0)


def _between(table: Float, place: float) -> Float:
    """Linear interpolation along the first axis, constant beyond its ends."""
    place = min(max(place, 0.0), len(table) - 1.0)
    low = min(int(place), len(table) - 2)
    return np.asarray(table[low] * (1 - place + low) + table[low + 1] * (place - low))


@cache
def _mitsuba_tables() -> dict[str, Float] | None:
    """The tables of an installed Mitsuba that has `sunsky`; None without one."""
    try:
        folder = Path(str(importlib.metadata.distribution("mitsuba").locate_file("mitsuba"))) / "data" / "sunsky"
        tables = _tensors(folder / "sunsky_datasets.bin") | _tensors(folder / "sampling_data.bin")
        expected = {"sky_params_rgb": (10, 2, 6, 3, 9), "sky_rad_rgb": (10, 2, 6, 3), "sun_irradiance": (10, 30, 11)}
        return tables if all(tables[n].shape == s for n, s in expected.items()) else None
    except (importlib.metadata.PackageNotFoundError, OSError, ValueError, KeyError, struct.error):
        return None


def _tensors(path: Path) -> dict[str, Float]:
    """Arrays of a tensor file by name: a header of 18 bytes, then for each its name, number of axes, type, offset and
    sizes. ValueError for anything else."""
    data = path.read_bytes()
    if not data.startswith(b"tensor_file\0"):
        raise ValueError("not a tensor file")
    (count,) = struct.unpack_from("<I", data, 14)
    at, found = 18, {}
    for _ in range(count):
        (length,) = struct.unpack_from("<H", data, at)
        name = data[at + 2 : at + 2 + length].decode("ascii", "replace")
        at += 2 + length
        axes, kind, offset = struct.unpack_from("<HBQ", data, at)
        sizes = struct.unpack_from(f"<{axes}Q", data, at + 11)
        at += 11 + 8 * axes
        if kind in (10, 11):
            numbers = np.frombuffer(data, "<f4" if kind == 10 else "<f8", math.prod(sizes), offset)
            found[name] = numbers.astype(np.float64).reshape(sizes)
    return found
