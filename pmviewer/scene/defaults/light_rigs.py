"""Lights to choose from instead of a file's: a sky, the sun, a headlight."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.defaults.framing import Up, axes_of, vec3
from pmviewer.scene.description import (
    Camera,
    ConstantEnvironment,
    DirectionalLight,
    ImageEnvironment,
    Light,
    PointLight,
)

Float = NDArray[np.float64]
Rig = Literal["auto", "file", "studio", "overcast", "sun", "headlight"]
BRIGHTNESS = 0.8
"""Radiance of a white surface that faces the light."""
GROUND_ALBEDO = 0.25
SKY_SHARE = 0.2
"""Of the sky in what a level surface receives on a sunny day."""
SUN_HEIGHT, SUN_ASIDE = 45.0, 55.0
"""Degrees: the sun's elevation, and how far it stands to the left of who looks at the scene."""
ABOVE_CAMERA = 0.05
"""The headlight's height above the eye, relative to the distance of what is looked at: highlights and a hint of shadows
show shape."""


def overcast_sky(up: Up) -> ImageEnvironment:
    """The CIE's standard overcast sky, L(γ) = L_z (1 + 2 sin γ) / 3 at elevation γ (Moon and Spencer, "Illumination
    from a non-uniform sky", 1942), over ground that reflects it. It lights level surfaces with π · `BRIGHTNESS`."""
    height, width = 64, 8
    elevation = (0.5 - (np.arange(height) + 0.5) / height) * math.pi
    zenith = BRIGHTNESS * 9 / 7  # the irradiance of a level surface is 7π/9 of the zenith's radiance
    ground = GROUND_ALBEDO * BRIGHTNESS
    radiance = np.where(elevation > 0, zenith * (1 + 2 * np.sin(elevation)) / 3, ground)
    pixels = np.broadcast_to(radiance[:, None, None], (height, width, 3)).astype(np.float32)
    right, top, front = axes_of(up)
    return ImageEnvironment("overcast sky", np.ascontiguousarray(pixels), np.stack([right, top, front], axis=1))


def sunlight(up: Up, camera: Camera) -> tuple[Light, ...]:
    """A sun from above and from the left of who looks, and a sky of one blue."""
    right, top, front = axes_of(up)
    back = np.subtract(camera.origin, camera.target)
    azimuth = math.atan2(float(back @ right), float(back @ front)) - math.radians(SUN_ASIDE)
    e = math.radians(SUN_HEIGHT)
    towards = math.cos(e) * (math.sin(azimuth) * right + math.cos(azimuth) * front) + math.sin(e) * top
    sun = (1 - SKY_SHARE) * BRIGHTNESS * math.pi / math.sin(e)
    sky = SKY_SHARE * BRIGHTNESS
    return (
        DirectionalLight("sun", vec3(-towards), (sun * 1.03, sun, sun * 0.92)),
        ConstantEnvironment("sky", (sky * 0.75, sky, sky * 1.45)),
    )


def headlight(camera: Camera, distance: float) -> PointLight:
    """A point just above the camera, as bright as lights what is `distance` away."""
    up = np.asarray(camera.up, float)
    at = np.asarray(camera.origin, float) + ABOVE_CAMERA * distance * up / max(float(np.linalg.norm(up)), 1e-300)
    return PointLight("headlight", vec3(at), (BRIGHTNESS * math.pi * distance**2,) * 3)
