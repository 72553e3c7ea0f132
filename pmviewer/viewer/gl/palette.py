"""Colours of points and lines, and what they stand for. `shaders/photon.glsl` turns photon records into them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pmviewer.output.colour_maps import FATES, SEQUENTIAL, TWO_SIDED
from pmviewer.output.false_look import Look
from pmviewer.scene.spectrum import shown_colours

RGB = tuple[float, float, float]

BOUNCE_PALETTE: tuple[RGB, ...] = (
    (0.99, 0.91, 0.15),
    (0.62, 0.85, 0.22),
    (0.29, 0.76, 0.43),
    (0.13, 0.63, 0.53),
    (0.20, 0.53, 0.70),
    (0.35, 0.44, 0.82),
    (0.53, 0.36, 0.80),
    (0.66, 0.30, 0.62),
)
"""None (straight from the light) to seven and more scatterings."""
LIGHT_PALETTE: tuple[RGB, ...] = (
    (0.95, 0.69, 0.15),
    (0.35, 0.71, 0.91),
    (0.10, 0.70, 0.50),
    (0.94, 0.89, 0.36),
    (0.25, 0.52, 0.85),
    (0.88, 0.45, 0.20),
    (0.84, 0.55, 0.72),
    (0.75, 0.75, 0.75),
)
"""Distinct with colour-blind eyes too (after Okabe and Ito); lights beyond the eighth start again."""

LIT_COLOUR: RGB = (1.0, 0.80, 0.25)
SHADOW_COLOUR: RGB = (0.35, 0.30, 0.95)
"""Of shadow photons where the light arrives and where it does not."""

ALL_WAVELENGTHS: RGB = (0.62, 0.62, 0.62)
"""Of photons that no glass has split yet."""

FATE_PALETTE: tuple[RGB, ...] = FATES["usual"]
"""Unless the display settings choose others: of photons that are stored, rejected, redistributed and discarded
(`pmviewer.photons.deposition.deposited.FATES`)."""


class By(IntEnum):
    """What a record's colour is taken from, as the shader counts it (`colour_by`)."""

    POWER = 0
    BOUNCES = 1
    LIGHT = 2
    LIT = 3
    QUANTITY = 4
    FATE = 5
    WAVELENGTH = 6
    DIRECTION = 7


MEAN_OF_GREEN_AND_BLUE = 3
"""A channel of its own, beside red, green and blue."""


@dataclass(frozen=True)
class Colouring:
    """How records become colours. A quantity is a channel of the stored power, in false colours.

    scale: of a quantity, between its percentiles; over all its range; as far above 1 as below; or down from the largest
    value, to a thousandth of it, as a share
    text: of a quantity, for the legend
    """

    by: By
    channel: int = 0
    scale: Literal["percentiles", "range", "around one", "share"] = "percentiles"
    text: str = ""

    def table(self, look: Look) -> NDArray[np.floating]:
        """(n, 3) false colours from small to large."""
        return TWO_SIDED[look.two_sided] if self.scale == "around one" else SEQUENTIAL[look.colours]


POWER = Colouring(By.POWER)
BOUNCES = Colouring(By.BOUNCES)
LIGHTS = Colouring(By.LIGHT)
WAVELENGTHS = Colouring(By.WAVELENGTH)
DIRECTIONS = Colouring(By.DIRECTION)


DIRECTION_PALETTE: tuple[tuple[str, RGB], ...] = (
    ("+x", (1.0, 0.5, 0.5)),
    ("+y", (0.5, 1.0, 0.5)),
    ("+z", (0.5, 0.5, 1.0)),
    ("−x", (0.0, 0.5, 0.5)),
    ("−y", (0.5, 0.0, 0.5)),
    ("−z", (0.5, 0.5, 0.0)),
)
"""Half of a unit vector's x, y and z around a half, as normals are shown."""


def palettes() -> dict[str, Any]:
    """Uniforms of `shaders/photon.glsl` that never change."""
    colours = {
        "bounce_palette": BOUNCE_PALETTE,
        "light_palette": LIGHT_PALETTE,
        "lit_colour": LIT_COLOUR,
        "shadow_colour": SHADOW_COLOUR,
        "wave_palette": np.concatenate([[ALL_WAVELENGTHS], shown_colours()]),
    }
    return {name: np.array(value, np.float32) for name, value in colours.items()}


@cache
def look_uniforms(look: Look) -> dict[str, NDArray[np.float32]]:
    """Those that the display settings choose."""
    tables = SEQUENTIAL[look.colours][::17], TWO_SIDED[look.two_sided][::17]
    return {
        "fate_palette": np.array(look.fate_colours, np.float32),
        "false_colours": np.concatenate(tables).astype(np.float32),
    }


def light_colour(number: int) -> RGB:
    """Of the light of that number, from 0."""
    return LIGHT_PALETTE[number % len(LIGHT_PALETTE)]
