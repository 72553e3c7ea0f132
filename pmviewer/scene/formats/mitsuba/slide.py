"""`spot` with a texture: a projector of the picture that the spot throws."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.scene.description import RGB, Light, ProjectorLight
from pmviewer.scene.formats.mitsuba.document import Properties
from pmviewer.scene.formats.mitsuba.projector import turned
from pmviewer.scene.texture import Bitmap, Texture, evaluate

WIDEST = 85.0
"""Degrees: the plane that a picture lies on is 23 times as wide as far there."""
LEAST, MOST = 512, 2048
"""Pixels along a side of the picture."""


def thrown(
    p: Properties, name: str, texture: Texture, intensity: RGB, cutoff: float, beam: float
) -> list[Light] | None:
    """The light of a <emitter type="spot"> with a texture: its intensity times that, over the square around the circle
    of the cut-off, falling linearly in the angle from `beam` (degrees). None where it is too wide for that; nothing,
    with a warning, where `to_world` is singular."""
    if cutoff > WIDEST:
        return None
    placed = turned(p, p.transform())
    if placed is None:
        return []
    height, width = texture.pixels.shape[:2] if isinstance(texture, Bitmap) else (LEAST, LEAST)
    n = min(max(height, width, LEAST), MOST)
    half = math.tan(math.radians(cutoff))
    places = np.linspace(0.0, 1.0, n + 1)
    x, y = np.meshgrid(half * (1 - 2 * places), half * (1 - 2 * places))
    across2 = x * x + y * y
    angle = np.degrees(np.arctan(np.sqrt(across2)))
    falling = (cutoff - angle) / max(cutoff - beam, 1e-9)
    # On what faces the axis a distance 1/cos away, intensity is cos³ as much irradiance.
    share = np.where(angle <= beam, 1.0, np.clip(falling, 0.0, 1.0)) * (1 + across2) ** -1.5
    pixels = np.empty((n + 1, n + 1, 3), np.float32)
    for row, v, shares in zip(pixels, places, share, strict=True):
        row[:] = evaluate(texture, np.stack([1 - places, np.full(n + 1, 1 - v)], axis=1))
        row *= shares[:, None] * np.asarray(intensity)
    at = tuple(float(c) for c in p.transform()[:3, 3])
    return [ProjectorLight(name, (at[0], at[1], at[2]), placed[0], (half, half), pixels, places, places)]
