"""The exposure that a picture is shown with where nobody has said one.

The camera meters as an incident-light meter does: what it aims at is not a grey picture but one in which surfaces look
as bright as they are. The log-average of what the surfaces in the picture send back (Reinhard, Stark, Shirley and
Ferwerda, "Photographic tone reproduction for digital images", 2002) is brought to `KEY` of the log-average of their
albedo, within `KEYS`; and then lower, if more than a few would be white.

It is decided once, by the first picture of a scene, so that refining and looking around change nothing.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.output.diagnostic_views import LUMINANCE
from pmviewer.render.planes import VOLUME_TERMS, view_of

KEY = 0.4
"""Share of the light that would make a surface look as bright as its albedo: parts lie in shadow or turn away."""
KEYS = (0.08, 0.4)
"""Lowest and highest log-average luminance of the picture, where 0.18 is the photographers' middle grey."""
BLOCKS = 24
"""The picture is averaged over so many fields either way, where few samples a pixel leave most black."""
WHITE_SHARE, MOST_LOWERED = 0.05, 3.0
"""Share of the fields that may be white, and EV that this may cost."""
DARKEST = 2e-3
"""Of the brightest fields' luminance: what is darker counts as that, or black corners would decide."""
STEP = 0.05


def metered(planes: NDArray[np.float32]) -> float:
    """Exposure in EV for a picture whose planes (h, w, n) are those of a frame; 0 for one without light.

    What shows nothing but the background, or glows, is left out unless there is nothing else.
    """
    light = _luminance(planes, "direct", "specular", "caustic", "indirect", *VOLUME_TERMS)
    glow = _luminance(planes, "emission")
    albedo = view_of(planes, "albedo").astype(np.float64) @ LUMINANCE
    something = (view_of(planes, "depth")[..., 0] > 0) | (_luminance(planes, *VOLUME_TERMS) > 0)
    surface = something & (glow <= light)
    values, weights = _blocks(light, surface)
    if not len(values) or not values.max() > 0:
        values, weights = _blocks(light + glow, np.ones(light.shape, bool))
        if not values.max() > 0:
            return 0.0
    mean = _log_average(values, weights)
    seen = albedo[surface & (albedo > 0)]
    key = KEY * math.exp(float(np.log(np.maximum(seen, 0.01)).mean())) if len(seen) else 0.18
    exposure = math.log2(min(max(key, KEYS[0]), KEYS[1]) / mean)
    bright = float(np.quantile(values, 1 - WHITE_SHARE, method="lower"))
    if bright > 0:  # else what shines is next to nothing of the picture
        exposure -= min(max(exposure + math.log2(bright), 0.0), MOST_LOWERED)
    return min(max(round(round(exposure / STEP) * STEP, 2), -20.0), 20.0)


def _luminance(planes: NDArray[np.float32], *terms: str) -> NDArray[np.float64]:
    """(h, w) of the sum of the terms; 0 where it is not finite."""
    total = sum(view_of(planes, term).astype(np.float64) for term in terms)
    return np.nan_to_num(np.asarray(total) @ LUMINANCE, posinf=0.0, neginf=0.0)


def _blocks(light: NDArray[np.float64], counts: NDArray[np.bool_]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean luminance of the counting pixels of each field of the picture, and the share of its pixels that count."""
    height, width = light.shape
    rows = (np.arange(height) * min(BLOCKS, height)) // height
    columns = (np.arange(width) * min(BLOCKS, width)) // width
    field = (rows[:, None] * BLOCKS + columns).ravel()
    number = np.bincount(field, counts.ravel())
    total = np.bincount(field, np.where(counts, light, 0.0).ravel())
    used = number > 0
    return total[used] / number[used], number[used].astype(np.float64)


def _log_average(values: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    bright = float(np.quantile(values, 0.95))
    least = DARKEST * (bright if bright > 0 else float(values.max()))
    return math.exp(float((np.log(np.maximum(values, least)) * weights).sum() / weights.sum()))
