"""What a pixel holds: the terms of the rendering equation's split and the properties of the first hit.

The terms follow Jensen's split (Jensen 1996, §4) at the first hit: light that the camera sees directly, direct light on
a diffuse surface, everything seen through a specular surface, caustics, and multiple diffuse reflection. The image is
their sum.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

TERMS = ("emission", "direct", "specular", "caustic", "indirect")
AOVS = ("albedo", "normal", "depth")

PLANES: dict[str, slice] = {name: slice(3 * i, 3 * i + 3) for i, name in enumerate(TERMS)} | {
    "albedo": slice(15, 18),
    "normal": slice(18, 21),
    "depth": slice(21, 22),
}
CHANNELS = 22


def beauty_of(planes: NDArray[np.float32]) -> NDArray[np.float32]:
    """The image (h, w, 3) of planes (h, w, 22): the terms added in float32 in the order of `TERMS`.

    Adding the exported terms in that order gives the exported image bit for bit.
    """
    image = planes[..., PLANES[TERMS[0]]].copy()
    for term in TERMS[1:]:
        image += planes[..., PLANES[term]]
    return image


def view_of(planes: NDArray[np.float32], view: str) -> NDArray[np.float32]:
    """The plane of that name as (h, w, 3) or, for depth, (h, w, 1); `beauty` is the sum of the terms."""
    return beauty_of(planes) if view == "beauty" else np.ascontiguousarray(planes[..., PLANES[view]])
