"""How large a trial is: pixels of its pictures, and photons, by what these cost.

It is planned by constants, clock or no clock, and made smaller where a small picture tells that they cost more: in a
hall full of gloss and textures a pixel costs three times as much.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from pmviewer.settings.access import SETTINGS

PER_PHOTON, PER_PIXEL = 1.5e-6, 6e-6
"""CPU seconds of a trial by trajectory and by pixel and candidate, as it is planned."""
OF_PHOTONS, OF_PIXELS = 0.35, 0.65
"""Shares of its time, as it is planned."""
OF_OTHERS = 10
"""Pictures that are rendered with other radii of shown maps, and with more light samples. The two of a gather with a
wider radius are not counted: with them a trial of four ways would not fit into four seconds (`LEAST`)."""
LEAST, LARGEST, FEWEST_PHOTONS = 40, 160, 20_000
"""Sides of the trial's picture in pixels, and N."""
PROBED = 1024
"""Pixels of the picture that tells what a trial costs. Its photons are `FEWEST_PHOTONS`."""
OF_DEAREST = 0.8
"""What a pixel of a trial's pictures costs in the mean, over one of a way that gathers (0.74 to 1.0 in nine scenes; 1.4
and 1.9 in two where it costs so little that no trial is made smaller)."""


class Size(NamedTuple):
    """Columns and rows of a trial's pictures, and the N of its larger passes."""

    width: int
    height: int
    N: int

    @property
    def pixels(self) -> int:
        """Of a picture."""
        return self.width * self.height

    def smaller(self, pixels: float, N: int) -> Size:
        """Of so many pixels and photons, none more than there are."""
        shrink = math.sqrt(min(pixels / self.pixels, 1.0))
        return Size(max(round(self.width * shrink), 1), max(round(self.height * shrink), 1), min(N, self.N))


def planned(budget: float, count: int, width: int, height: int) -> Size | None:
    """For that many CPU seconds and candidates, of a picture that wide and high; None where they are too few."""
    N = min(int(SETTINGS["photons.N"].default), int(OF_PHOTONS * budget / PER_PHOTON / 2))
    pixels = OF_PIXELS * budget / (PER_PIXEL * (count * 4 + OF_OTHERS))
    if N < FEWEST_PHOTONS or pixels < LEAST**2:
        return None
    return Size(width, height, N).smaller(min(pixels, LARGEST**2), N)


def fitted(size: Size, per_pixel: float, per_trajectory: float, seconds: float) -> Size:
    """Fewer pixels and photons where either would take longer, at so many CPU seconds by pixel of all pictures, or by
    trajectory; as many where they cost nothing."""
    pixels = seconds / per_pixel if per_pixel > 0 else math.inf
    N = seconds / per_trajectory if per_trajectory > 0 else math.inf
    return size.smaller(max(pixels, LEAST**2), int(max(min(N, size.N), FEWEST_PHOTONS)))
