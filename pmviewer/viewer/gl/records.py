"""Photon records (`pmviewer.maps.record`, which would bring numba along) as the window reads and writes them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.viewer.gl.palette import MEAN_OF_GREEN_AND_BLUE, POWER, By, Colouring

LAYOUT = "3f4 1u4 2u4"
"""Of a record as attributes of a vertex."""
ATTRIBUTES = ("position", "direction_and_flags", "power_and_light")
RECORD_BYTES = 24
EXPONENT_BASE = 80 << 23
"""Of stored powers."""
_LIGHTS_LISTED = 64


def encoded(values: NDArray[np.floating]) -> NDArray[np.uint32]:
    """Stored powers' 16-bit codes of non-negative values."""
    bits = np.ascontiguousarray(values, np.float32).view(np.uint32).astype(np.int64)
    return np.clip((bits + 0x1000 - EXPONENT_BASE) >> 13, 0, 0xFFFF).astype(np.uint32)


def _decoded(codes: NDArray[np.uint32]) -> NDArray[np.float32]:
    return np.where(codes == 0, np.float32(0), ((codes << np.uint32(13)) + np.uint32(EXPONENT_BASE)).view(np.float32))


def _channels(records: NDArray[np.float32]) -> NDArray[np.float32]:
    """(3, n) powers of records (n, 6), in units of the map's power."""
    words = records.view(np.uint32)
    return _decoded(np.stack([words[:, 4] & 0xFFFF, words[:, 4] >> 16, words[:, 5] & 0xFFFF]).astype(np.uint32))


def brightest_channel(records: NDArray[np.float32]) -> NDArray[np.float32]:
    """(n,) brightest of the three channels of records (n, 6), in units of the map's power."""
    return _channels(records).max(axis=0)


def quantity(records: NDArray[np.float32], colouring: Colouring) -> NDArray[np.float32]:
    """(n,) what records (n, 6) are coloured by, in units of the map's power; the brightest channel where it is none of
    a single channel."""
    if colouring.by != By.QUANTITY:
        return brightest_channel(records)
    channels = _channels(records)
    if colouring.channel == MEAN_OF_GREEN_AND_BLUE:
        return (channels[1] + channels[2]) / 2
    return channels[colouring.channel]


def directions(records: NDArray[np.float32]) -> NDArray[np.float64]:
    """Unit directions (n, 3) of records (n, 6)."""
    codes = records.view(np.uint32)[:, 3].astype(np.int64)
    u, v = ((codes >> 20) - 2047) / 2047, ((codes >> 8 & 0xFFF) - 2047) / 2047
    z = 1 - np.abs(u) - np.abs(v)
    fold = np.maximum(-z, 0)
    d = np.stack([np.where(u >= 0, u - fold, u + fold), np.where(v >= 0, v - fold, v + fold), z], axis=1)
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def tags(records: NDArray[np.float32]) -> NDArray[np.uint32]:
    """(n,) numbers of the lights of records (n, 6), or of what stands in their place."""
    return records.view(np.uint32)[:, 5] >> np.uint32(16)


def with_tags(records: NDArray[np.float32], numbers: NDArray[np.integer]) -> NDArray[np.float32]:
    """Records (n, 6) with those numbers (n,) in the lights' places; the largest that there is room for is 65535."""
    words = records.view(np.uint32).copy()
    words[:, 5] = (words[:, 5] & np.uint32(0xFFFF)) | np.minimum(numbers, 0xFFFF).astype(np.uint32) << np.uint32(16)
    return words.view(np.float32)


@dataclass(frozen=True)
class CloudSummary:
    """For the legend: records in all, those drawn, and the ends of the scale of their power in watts."""

    total: int
    drawn: int
    power_low: float
    power_high: float
    lights: tuple[int, ...]
    """Ids of the lights they came from, of a sample."""


EMPTY = CloudSummary(0, 0, 0.0, 0.0, ())


def ends_of_scale(records: NDArray[np.float32], colouring: Colouring = POWER) -> tuple[float, float]:
    """The values of records (n, 6) at the ends of the scale of colours: the 1st and 99th percentile of those that are
    above 0, unless the colouring says otherwise."""
    values = quantity(records, colouring)
    some = values[values > 0]
    low, high = np.percentile(some, [1, 99]) if len(some) else (1.0, 1.0)
    if colouring.by != By.QUANTITY:
        return float(low), float(high)
    if colouring.scale == "range":
        low, high = (float(some.min()), float(some.max())) if len(some) else (1.0, 1.0)
    if colouring.scale == "around one":
        reach = max(2.0, 1.0 / low, high)
        return 1.0 / reach, reach
    if colouring.scale == "share":  # every light counts, down to a thousandth of the most important one
        high = float(values.max(initial=1e-6))
        low = max(float(some.min(initial=high)), 1e-3 * high)
    return float(min(low, 0.8 * high)), float(high)


def log_range(records: NDArray[np.float32], colouring: Colouring = POWER) -> tuple[float, float]:
    """Logarithms (base 2) of the powers that are drawn dim and bright; those that hardly differ are all bright. Other
    quantities are drawn in false colours between the ends of their scale."""
    low, high = ends_of_scale(records, colouring)
    return float(np.log2(low if colouring.by == By.QUANTITY else min(low, high / 16))), float(np.log2(high))


def summary_of(
    sample: NDArray[np.float32], power_unit: float, total: int, drawn: int, colouring: Colouring = POWER
) -> CloudSummary:
    """What the legend says of `total` records of which `sample` (n, 6) are some."""
    low, high = ends_of_scale(sample, colouring)
    lights = tuple(int(i) for i in np.unique(tags(sample))[:_LIGHTS_LISTED])
    return CloudSummary(total, drawn, low * power_unit, high * power_unit, lights)
