"""Look-up radii of their own for pixels, shrunk by what each finds (E6; Hachisuka, Ogaki & Jensen 2008; with many
samples a pixel, Hachisuka & Jensen 2009).

A pixel has a radius for either map at the surfaces that it sees. N photons count so far; after a pass whose look-ups
there found M more,

    r'² = r²·(N + α·M)/(N + M),   N' = N + α·M:

it shrinks where photons are many, in caustics, and waits where there are none.

The source adds up powers found within different radii, and rescales the sum (τ) as if the photons of a larger disc
had been spread evenly. Here a pass's estimate is divided by the area of its own disc, and the passes' estimates are
averaged plainly, as with a radius a pass (Knaus & Zwicker 2011): the radius of a pass is known before its photons are
traced, so each estimate has the bias of its radius and no other, and as the radii go to 0, so does that of the mean.

Without the rule radii are None, and nothing of this is compiled.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.specialise import absent, part, specialised
from pmviewer.kernels.memory import row_of
from pmviewer.render.lookup import looked_up

OF_CAUSTIC, OF_GLOBAL = 0, 1
RADIUS, COUNTED, FOUND = 0, 2, 4
"""First of the two columns, caustic and global, of radii in scene units, N before the pass, and M in the pass."""

COLUMNS = 6
_f4 = np.float32


def first_radii(pixels: int, caustic: float, global_: float) -> NDArray[np.float32]:
    """Of the first pass: (pixels, COLUMNS)."""
    radii = np.zeros((pixels, COLUMNS), np.float32)
    radii[:, RADIUS + OF_CAUSTIC], radii[:, RADIUS + OF_GLOBAL] = caustic, global_
    return radii


def shrink(radii: NDArray[np.float32], alpha: float, floor: float) -> None:
    """What a pass found makes the radii of the next, not below `floor` (scene units)."""
    for which in (OF_CAUSTIC, OF_GLOBAL):
        r, N, M = (radii[:, column + which].astype(np.float64) for column in (RADIUS, COUNTED, FOUND))
        shrunk = r * np.sqrt(np.divide(N + alpha * M, N + M, out=np.ones_like(r), where=M > 0))
        radii[:, RADIUS + which] = np.maximum(shrunk, np.minimum(floor, r))
        radii[:, COUNTED + which] = N + alpha * M
        radii[:, FOUND + which] = 0


@specialised
def own_radius(radii, which, radius):
    """A pixel's radius for a map, OF_CAUSTIC or OF_GLOBAL, from its row; that of the pass where there is None."""
    if absent(radii):
        return lambda radii, which, radius: radius
    return lambda radii, which, radius: radii[RADIUS + which]


@specialised
def radii_of(radii, pixel):
    """The pixel's row of radii (pixels, COLUMNS); None of None."""
    if absent(radii):
        return lambda radii, pixel: None
    return lambda radii, pixel: row_of(radii, pixel)


@specialised
def count_found(pixel, which, photons, eye, radius, si, class_mask):
    """Tell the pixel (`pmviewer.render.pixel.Pixel`) how many photons its look-up counted; the other arguments as for
    `pmviewer.render.lookup.irradiance`."""
    if absent(part(pixel, "radii")):
        return lambda pixel, which, photons, eye, radius, si, class_mask: None

    def told(pixel, which, photons, eye, radius, si, class_mask):
        _, found = looked_up(photons, eye, radius, si.p, si.ng, class_mask)
        pixel.radii[FOUND + which] += found

    return told
