"""What two pictures differ by, pixel by pixel: A is judged, B is what it is judged by.

All are one number a pixel, shown in false colours. A and B are radiances (h, w, 3) of one size.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.output.diagnostic_views import LUMINANCE
from pmviewer.output.flip import flip_error
from pmviewer.output.metric import EPSILON, squared_error

FLOOR = float(np.sqrt(EPSILON))
"""Added to what is divided by, W/(m² sr): the relative errors' 0.01 is its square."""


def difference(kind: str, a: NDArray[Any], b: NDArray[Any]) -> NDArray[np.float32]:
    """(h, w) float32 by a kind of `pmviewer.output.difference_views`; NaN where either picture is not finite.

    Raises ValueError for pictures of different sizes, OutputError for FLIP where its evaluator lacks.
    """
    if a.shape != b.shape:
        raise ValueError(f"pictures of shapes {a.shape} and {b.shape} can't be compared")
    if kind == "FLIP":
        return flip_error(a, b)
    with np.errstate(over="ignore", invalid="ignore"):
        return _plain(kind, a, b).astype(np.float32)


def _plain(kind: str, a: NDArray[Any], b: NDArray[Any]) -> NDArray[np.float64]:
    if kind == "relMSE":
        return squared_error(a, b)
    x, y = np.asarray(a, np.float64), np.asarray(b, np.float64)
    if kind in ("signed", "relative"):
        weights = np.array(LUMINANCE)
        judged, by = x @ weights, y @ weights
        return judged - by if kind == "signed" else (judged - by) / (np.abs(by) + FLOOR)
    off = np.abs(x - y)
    return off.mean(axis=-1) if kind == "absolute" else 100 * (off / (np.abs(y) + FLOOR)).mean(axis=-1)


def mean_difference(kind: str, plane: NDArray[np.floating]) -> float:
    """The picture's one number: the mean over all pixels that are finite; NaN where none is."""
    good = plane[np.isfinite(plane)]
    return float(good.mean(dtype=np.float64)) if good.size else float("nan")
