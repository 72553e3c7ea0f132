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
TERMS_END = PLANES[TERMS[-1]].stop
"""Columns of the terms that all scenes have."""
CHANNELS = 22
VOLUME_TERMS = ("volume", "volume indirect")
"""Terms of scenes with participating media: light that media scatter once on its way from a light to the camera, and
what comes to them over more. They stand behind the planes that all scenes have."""
PLANES |= {"volume": slice(22, 25), "volume indirect": slice(25, 28)}
MEDIA_CHANNELS = 28


def terms_of(channels: int) -> tuple[str, ...]:
    """The terms of a film with so many planes, in the order in which their sum is the image."""
    return TERMS if channels < MEDIA_CHANNELS else (*TERMS, *VOLUME_TERMS)


def beauty_of(planes: NDArray[np.float32]) -> NDArray[np.float32]:
    """The image (h, w, 3) of planes (h, w, 22 or 28): the terms added in float32 in the order of `terms_of`.

    Adding the exported terms in that order gives the exported image bit for bit.
    """
    image = planes[..., PLANES[TERMS[0]]].copy()
    for term in terms_of(planes.shape[-1])[1:]:
        image += planes[..., PLANES[term]]
    return image


def view_of(planes: NDArray[np.float32], view: str) -> NDArray[np.float32]:
    """The plane of that name as (h, w, 3) or, for depth, (h, w, 1); `beauty` is the sum of the terms. Black for a term
    of media in a scene without."""
    if view in VOLUME_TERMS and planes.shape[-1] < MEDIA_CHANNELS:
        return np.zeros((*planes.shape[:2], 3), np.float32)
    return beauty_of(planes) if view == "beauty" else np.ascontiguousarray(planes[..., PLANES[view]])
