"""What a file's answers mean: does it open, and is it the picture that Mitsuba 3 makes of it?"""

from __future__ import annotations

import math
import re
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

TOLERANCE = 0.02
"""Of a channel's mean, besides noise."""
NOISE_BOUND = 0.01
SIGMAS = 2.0
FAINT = 1e-3
"""Part of the brightest channel's mean below which a difference between channels is none: a ratio of two nearly black
channels says nothing."""
HARMLESS = re.compile(
    r"<(?:integrator|sampler|rfilter|film|mode)\b|of <(?:integrator|sampler|rfilter|film)\b|max_depth|maxDepth"
    r"|'(?:shutter|focus|near|far)\w*' of <sensor|not of unit length|trilinear|\bewa\b|never used|is unused"
    r"|^Parameter '|is cut into triangles|is moved there",
)
"""Warnings about what does not change the compared picture: they excuse no difference."""
JUDGEMENTS = {
    "agrees": "every channel's mean within 2 % (and twice the noise, at most 2 %) of Mitsuba's",
    "noisy": "within twice the noise, which is more than 1 %: more samples would be needed to tell",
    "said": "differs, and a warning of ours says what is missing",
    "differs": "differs, and no warning says why",
    "not compared": "no XML, or Mitsuba 3 does not render it",
    "error": "does not open",
    "crash": "a traceback, or more time or memory than any file should take",
}


@dataclass
class Row:
    """What came out for a file, as it is kept. Means are (n, 3) lists of independent samples; None: not tried."""

    file: str
    state: str
    why: str = ""
    error: str = ""
    crash: str = ""
    seconds: float = math.nan
    triangles: int = 0
    warnings: list[str] = field(default_factory=list)
    luminance: float = math.nan
    grey: float = math.nan
    dark: float = math.nan
    default: list[float] = field(default_factory=list)
    ours: list[list[float]] = field(default_factory=list)
    theirs: list[list[float]] = field(default_factory=list)
    refused: str = ""
    adapted: str = ""
    media: bool = False
    sizes: list[list[int]] = field(default_factory=list)
    png: str = ""

    def as_dict(self) -> dict[str, Any]:
        """For JSON, as `--json` keeps it."""
        return asdict(self)

    @property
    def opens(self) -> bool:
        """Whether our loader took it, in a process that lived."""
        return not (self.error or self.crash)

    @property
    def compared(self) -> bool:
        """Whether both sides have a picture."""
        return bool(self.ours and self.theirs)

    @property
    def ratio(self) -> NDArray[np.float64]:
        """(3,) our mean over theirs; NaN where there is nothing to compare."""
        if not self.compared:
            return np.full(3, math.nan)
        return _over(np.mean(self.ours, axis=0), np.mean(self.theirs, axis=0))

    @property
    def default_ratio(self) -> NDArray[np.float64]:
        """(3,) of the default method's picture."""
        if not (self.default and self.theirs):
            return np.full(3, math.nan)
        return _over(np.array(self.default), np.mean(self.theirs, axis=0))

    @property
    def noise(self) -> float:
        """Relative standard error of the ratio in the worst channel that is not faint."""
        if not self.compared:
            return math.nan
        ours, theirs = np.array(self.ours), np.array(self.theirs)
        seen = theirs.mean(axis=0) > 10 * FAINT * theirs.mean(axis=0).max()
        return float(np.hypot(_error(ours), _error(theirs))[seen].max()) if seen.any() else 0.0

    @property
    def judgement(self) -> str:
        """One of `JUDGEMENTS`."""
        if self.crash:
            return "crash"
        if self.error:
            return "error"
        if not self.compared:
            return "not compared"
        if self._within():
            return "agrees" if self.noise <= NOISE_BOUND else "noisy"
        return "said" if any(not HARMLESS.search(text) for text in self.warnings) else "differs"

    def _within(self) -> bool:
        ours, theirs = np.array(self.ours), np.array(self.theirs)
        a, b = ours.mean(axis=0), theirs.mean(axis=0)
        if not (np.isfinite(a).all() and np.isfinite(b).all()):
            return False
        sigma = np.hypot(_error(ours) * np.abs(a), _error(theirs) * np.abs(b))
        return bool((np.abs(a - b) <= TOLERANCE * b + SIGMAS * sigma + FAINT * b.max()).all())


def _over(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """a / b; 1 where both are 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where((a == 0) & (b == 0), 1.0, a / b)


def _error(means: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3,) relative standard errors of (n, 3) independent means."""
    mean = means.mean(axis=0)
    if len(means) < 2:
        return np.zeros(3)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(mean > 0, means.std(axis=0, ddof=1) / math.sqrt(len(means)) / mean, 0.0)
