"""How much light the scene's lights emit (T1), in closed form."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.arrays.sky_table import sky_integral
from pmviewer.scene.description import (
    ConstantEnvironment,
    DirectionalLight,
    Light,
    PointLight,
    ProjectorLight,
    SpotLight,
)
from pmviewer.scene.projector import projector_power

RGBArray = NDArray[np.float64]


def spot_solid_angle(light: SpotLight) -> float:
    """∫ of the falloff over all directions: 2π·(1 − (sin c − sin b)/(c − b)) with cut-off c and beam width b."""
    cutoff, beam = math.radians(light.cutoff), math.radians(light.beam)
    slope = math.cos(cutoff) if cutoff == beam else (math.sin(cutoff) - math.sin(beam)) / (cutoff - beam)
    return 2 * math.pi * (1 - slope)


def emitted_power(light: Light, radius: float) -> RGBArray:
    """Power (3,) in watts that a light without a surface sends into a scene with a bounding sphere of that radius.

    Of light from outside it is what passes through the sphere: π R² for each direction.
    """
    disc = math.pi * radius**2
    if isinstance(light, PointLight):
        return 4 * math.pi * np.array(light.intensity)
    if isinstance(light, SpotLight):
        return spot_solid_angle(light) * np.array(light.intensity)
    if isinstance(light, ProjectorLight):
        return projector_power(light)
    if isinstance(light, DirectionalLight):
        return disc * np.array(light.irradiance)
    if isinstance(light, ConstantEnvironment):
        return 4 * math.pi * disc * np.array(light.radiance)
    return disc * sky_integral(light.pixels)
