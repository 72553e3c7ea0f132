"""A picture taken apart into what a filter may smooth and what the first hits give back, and put together again."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.render.planes import PLANES

F4 = NDArray[np.float32]
LEAST_ALBEDO = 0.02
"""What light is divided by at least: black surfaces would give all of their noise to their neighbours."""
DIFFUSE = ("direct", "caustic", "indirect")


def signals_of(planes: F4) -> F4:
    """(h, w, 6) of planes (h, w, 22): light of the first surface's stored lobes over its albedo, and light of followed
    lobes."""
    signals = np.empty((*planes.shape[:2], 6), np.float32)
    light = signals[..., :3]
    np.copyto(light, planes[..., PLANES[DIFFUSE[0]]])
    for term in DIFFUSE[1:]:
        light += planes[..., PLANES[term]]
    light /= np.maximum(planes[..., PLANES["albedo"]], LEAST_ALBEDO)
    signals[..., 3:] = planes[..., PLANES["specular"]]
    return signals


def guides_of(planes: F4) -> F4:
    """(h, w, 4) of planes (h, w, 22): unit normal, 0 where nothing is met, and distance along the view."""
    guides = np.empty((*planes.shape[:2], 4), np.float32)
    normal = planes[..., PLANES["normal"]]
    length = np.sqrt(np.einsum("yxc,yxc->yx", normal, normal))
    guides[..., :3] = normal / np.maximum(length, 1e-6)[..., None]
    guides[..., 3] = planes[..., PLANES["depth"]][..., 0]
    return guides


def picture_of(signals: F4, planes: F4) -> F4:
    """(h, w, 3) radiance of signals (h, w, 6), with albedo and emission of planes (h, w, 22)."""
    picture = signals[..., :3] * np.maximum(planes[..., PLANES["albedo"]], LEAST_ALBEDO)
    picture += signals[..., 3:]
    picture += planes[..., PLANES["emission"]]
    return picture


def halved(values: F4) -> F4:
    """(h/2, w/2, n) means of (h, w, n); an odd last row or column is left out."""
    h, w = values.shape[0] // 2, values.shape[1] // 2
    cut = values[: 2 * h, : 2 * w]
    total = cut[0::2, 0::2] + cut[1::2, 0::2]
    total += cut[0::2, 1::2]
    total += cut[1::2, 1::2]
    total *= np.float32(0.25)
    return total
