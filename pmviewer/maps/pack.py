"""Photons from arrays, as files have them: the inverse of `pmviewer.maps.record.unpack`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.maps.record import BOUNCES, EXPONENT_BASE


def pack(
    position: NDArray[np.floating],
    wi: NDArray[np.floating],
    Phi: NDArray[np.floating],
    bounces: NDArray[np.integer],
    path_class: NDArray[np.integer],
    light: NDArray[np.integer],
) -> tuple[NDArray[np.float32], float]:
    """Records (n, 6) and their unit of power in W, the largest power of one; what is negative or not finite has none.
    Shapes and units as `unpack` gives them."""
    Phi = np.where(np.isfinite(Phi) & (Phi > 0), Phi, 0.0)
    unit = float(Phi.max(initial=0.0)) or 1.0
    bits = (Phi / unit).astype(np.float32).view(np.uint32).astype(np.int64)
    codes = np.where(Phi > 0, np.clip((bits - EXPONENT_BASE + 0x1000) >> 13, 0, 0xFFFF), 0).astype(np.uint32)
    records = np.zeros((len(position), 6), np.float32)
    records[:, :3] = position
    words = records.view(np.uint32)
    flags = (path_class.astype(np.uint32) & 3) << 6 | np.minimum(bounces, BOUNCES).astype(np.uint32)
    words[:, 3] = _directions(wi) | flags
    words[:, 4] = codes[:, 0] | codes[:, 1] << np.uint32(16)
    words[:, 5] = codes[:, 2] | (light.astype(np.uint32) & 0xFFFF) << np.uint32(16)
    return records, unit


def _directions(wi: NDArray[np.floating]) -> NDArray[np.uint32]:
    """Octahedral codes of unit vectors (n, 3), in the high 24 bits."""
    with np.errstate(invalid="ignore", divide="ignore"):
        flat = np.nan_to_num(np.asarray(wi, np.float64) / np.abs(wi).sum(axis=1, keepdims=True))
    u, v = flat[:, 0], flat[:, 1]
    below = flat[:, 2] < 0
    folded_u = (1 - np.abs(v)) * np.where(u >= 0, 1, -1)
    folded_v = (1 - np.abs(u)) * np.where(v >= 0, 1, -1)
    u, v = np.where(below, folded_u, u), np.where(below, folded_v, v)
    parts = [(np.rint(part * 2047).astype(np.int64) + 2047).astype(np.uint32) for part in (u, v)]
    return np.asarray(parts[0] << np.uint32(20) | parts[1] << np.uint32(8), np.uint32)
