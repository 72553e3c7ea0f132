"""Light from outside the scene: discs behind the bounding sphere that photons start on, and directional lights (T1).

A directional light is Mitsuba 3's `directional`: parallel light of an irradiance E on what faces it. What reaches the
scene passes through a disc as wide as the bounding sphere: Φ = π R² E.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.scene import L_B, L_RADIANCE, light_vector
from pmviewer.kernels.vector import along, basis, dot, luminance, scale
from pmviewer.kernels.warp import square_to_disk

_f4 = np.float32


@device
def distance_to_center(scene, x):
    """Of x from the centre of the scene's bounding sphere."""
    d = (x[0] - scene.center_x, x[1] - scene.center_y, x[2] - scene.center_z)
    return _f4(math.sqrt(dot(d, d)))


@device
def outside(scene, x, wi):
    """A point in direction wi from x that lies beyond everything in the scene."""
    return along(x, wi, _f4(2.0) * (scene.radius + distance_to_center(scene, x)))


@device
def behind_scene(scene, d, u, v):
    """Where a photon in direction d starts: uniform on the disc that touches the bounding sphere, across d."""
    x, y = square_to_disk(u, v)
    r = scene.radius
    s, t = basis(d)
    return (
        scene.center_x + r * (x * s[0] + y * t[0] - d[0]),
        scene.center_y + r * (x * s[1] + y * t[1] - d[1]),
        scene.center_z + r * (x * s[2] + y * t[2] - d[2]),
    )


@device
def sample_directional(scene, light, x):
    """As `pmviewer.kernels.lights.light.sample_one_light`; L is the irradiance, L/pdf makes it that of the light."""
    wi = scale(light_vector(scene, light, L_B), _f4(-1.0))
    return wi, outside(scene, x, wi), light_vector(scene, light, L_RADIANCE), _f4(1.0), False


@device
def emit_directional(scene, light, u, v):
    """Origin, unit direction and power (luminance 1) of a photon."""
    L = light_vector(scene, light, L_RADIANCE)
    d = light_vector(scene, light, L_B)
    return behind_scene(scene, d, u, v), d, scale(L, _f4(1.0) / luminance(L))
