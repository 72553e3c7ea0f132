"""How wrong the picture still is, from the picture alone: relMSE with an interval.

Passes complement one another: their samples are parts of one sequence, so that the mean of n of them is nearer to the
truth than n independent ones would be, and the scatter of passes says too much. What can be seen is D(m), half the
squared difference of the means of m passes and of the m after them. From the variance V of the mean,
V(2m) = V(m) − D(m)/2, and since V goes to 0, V(n) = (D(n) + D(2n) + D(4n) + …)/2. What falls as D(m) = c·m⁻ᵖ has
therefore V(n) = D(n/2)/(2·(2ᵖ − 1)): the usual D/2 for independent passes, p = 1, less for others. One power fitted to
all D promises too much where they bend, a sum of parts that fall with p = 1.5 (samples that complement one another),
1 (independent ones) and, where look-ups shrink, 2/3 (photons) too little: the estimate is the geometric mean of both.

D is taken at n = 2, 4, 6, 8, 12, 16, 24 …, so that all other passes cost nothing. Halves don't tell the bias that both
have: it is added where a trial has measured it (`pmviewer.engine.auto.trial`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.auto.bias import Bias
from pmviewer.engine.auto.relative import part_means
from pmviewer.engine.plan import Plan
from pmviewer.engine.remaining import Remaining
from pmviewer.output.metric import EPSILON
from pmviewer.render.film import Film
from pmviewer.settings.access import Settings
from pmviewer.state import State
from pmviewer.tasks import Runner, in_turn

POWERS = (1.5, 1.0)
SHRINKING = 2.0 / 3.0
"""Powers with which parts of D fall; the last where look-ups shrink by the usual alpha."""
USUAL, USUAL_ERROR = 1.25, 0.3
"""p of most pictures, and its standard deviation."""
ROUGHNESS = 0.2
"""Relative error of D beside the noise: sequences are better at some numbers of passes than at others."""
UNSURE = 0.35
"""Relative error of an estimate by one value of D beside that; it falls with the root of their number."""
AROUND = (3, 7)
"""Pixels along the sides of the boxes whose means, the lesser of both, stand for what a noisy pixel ought to show."""
BLOCKS = 8
"""Blocks along each side of the picture whose differences tell how well D is known."""
BAND = 16
"""Rows of the picture a task."""
TRUE_BIAS = 1 / 3, 2.0
"""The least and the most of the squared bias that a trial tells which it may be."""
LEAST = 1e-30
"""Variance of a pixel, at least: where nothing varies nothing is divided by 0."""
WIDTH = 1.645
"""Standard errors of an interval that is to cover 90 %."""
F8 = NDArray[np.float64]


@dataclass(frozen=True)
class _Level:
    """D of so many passes against the next, and its relative standard error."""

    passes: int
    D: float
    error: float


class ErrorEstimate:
    """Follows one film from pass to pass. `tells` is False where all passes share what is wrong with them; `bias`, if
    anybody sets it, gives the squared relative bias after so many passes. reach: how many pixels away the film's filter
    still finds a pixel's samples."""

    def __init__(self, width: int, height: int, settings: Settings, plan: Plan, reach: int = 0) -> None:
        self._size = width, height
        self._apart = 2 * reach + 1
        self.tells = plan.moments and settings.photons.renew == "each pass"
        self.bias: Bias | None = None
        shrinks = plan.shown_directly | plan.caustic_mask | plan.volume and settings.estimate.alpha < 1.0
        self._shrinks_after = settings.estimate.delay if shrinks else math.inf
        self._sums: dict[int, F8] = {}
        """Sums of the image over the first passes, by their number; those that will be compared yet."""
        self._levels: list[_Level] = []
        self._passes = 0

    def add(self, film: Film, run: Runner = in_turn) -> None:
        """After each pass of the film. Others than those of the module's list are only counted. `run` does tasks."""
        n = self._passes = film.passes
        if not self.tells or film.moments is None or not _is_level(n):
            return
        w, h = self._size
        x0, y0, x1, y1 = film.region or (0, 0, w, h)
        image = film.moments.image.reshape(h, w, 3)[y0:y1, x0:x1]
        total = self._sums[n] = np.empty(image.shape)
        rows = [slice(begin, begin + BAND) for begin in range(0, len(image), BAND)]
        tasks: list[Callable[[], Any]] = [partial(np.copyto, total[part], image[part]) for part in rows]
        half = self._sums.pop(n // 2, None) if n % 2 == 0 else None
        if half is not None:
            tasks += [partial(_of_band, half, image, n // 2, part.start, self._apart) for part in rows]
        made = run(tasks)
        if half is not None:
            level = _level(np.concatenate(made[len(rows) :]), n // 2)
            if math.isfinite(level.D) and math.isfinite(level.error):  # a film that is not tells nothing
                self._levels.append(level)

    def state(self) -> State:
        """What the passes have told so far; with the bias, where a trial has measured it."""
        bias = None if self.bias is None else asdict(self.bias)
        numbers = {"passes": self._passes, "levels": [asdict(level) for level in self._levels], "bias": bias}
        return State(numbers, {f"sums.{n}": total for n, total in self._sums.items()})

    def restore(self, state: State) -> None:
        """Go on from there. Raises ValueError where that is of another film."""
        names = {int(name.removeprefix("sums.")): name for name in state.arrays}
        self._sums = {n: state.array(name, (None, None, 3), np.float64) for n, name in sorted(names.items())}
        self._levels = [_Level(**level) for level in state.number("levels")]
        self._passes, bias = int(state.number("passes")), state.number("bias")
        self.bias = None if bias is None else Bias.restored(bias)

    @property
    def latest(self) -> Remaining | None:
        """Of the film as it is; None before the second pass."""
        if not self._levels:
            return None
        last = self._levels[-1]
        n, p = self._passes, _power(self._levels)
        powers = (*POWERS, SHRINKING) if n > self._shrinks_after else POWERS
        one = last.D * (2 * last.passes / n) ** p / (2 * (2**p - 1))
        several = sum(c * n**-p for p, c in _parts(self._levels, powers)) or one
        value = math.sqrt(one * several)
        spread = math.sqrt(last.error**2 + ROUGHNESS**2 + UNSURE**2 / len(self._levels))
        if not math.isfinite(value) or value <= 0:
            return None
        bias = float(self.bias(self._passes)) if self.bias is not None else None
        added = bias or 0.0
        factor = math.exp(WIDTH * spread)
        low, high = (share * added for share in TRUE_BIAS)
        return Remaining(value + added, bias, value / factor + low, value * factor + high)


def _is_level(n: int) -> bool:
    """Powers of two, and those times 3/2."""
    return n & (n - 1) == 0 or (n % 3 == 0 and (n // 3) & (n // 3 - 1) == 0)


def _of_band(first: F8, total: F8, m: int, begin: int, apart: int) -> F8:
    """Relative squared differences, in BAND rows, of m passes, whose sum is `first`, against the m passes after them;
    `total` is the sum of both. Pixels so far `apart` share no samples. The mean over channels."""
    end, reach = min(begin + BAND, len(total)), max(max(AROUND) // 2, apart)
    top, bottom = max(begin - reach, 0), min(end + reach, len(total))
    asked = slice(begin - top, end - top)
    plane = np.zeros((end - begin, total.shape[1]))
    for c in range(3):
        mean = total[top:bottom, :, c] / (2 * m)
        square = (2 * first[top:bottom, :, c] - total[top:bottom, :, c]) ** 2 / (2 * m * m)
        plane += (square / (_seen(mean, square / 2, apart) ** 2 + EPSILON))[asked] / 3
    return plane


def _seen(mean: F8, variance: F8, apart: int) -> F8:
    """What the pixels (h, w) of that mean and about that variance show: what those around them do, and what they differ
    by from these as far as it stands out of the noise there (Wiener). A pixel that is brighter than all those so far
    `apart`, which share no samples with it, counts as the brightest of them: what one path made would hide in its own
    brightness."""
    from scipy.ndimage import maximum_filter, uniform_filter  # late: processes that only compile start without

    around = np.minimum(*(uniform_filter(mean, size) for size in AROUND))
    ring = np.ones((2 * apart + 1, 2 * apart + 1), bool)
    ring[1:-1, 1:-1] = False
    own = np.minimum(mean, maximum_filter(mean, footprint=ring, mode="mirror")) - around
    signal, noise = own**2, np.maximum(uniform_filter(variance, AROUND[0]), LEAST)
    return np.asarray(around + signal / (signal + noise) * own)


def _level(plane: F8, m: int) -> _Level:
    """D of m passes from the relative squared differences of all pixels."""
    blocks = part_means(plane, BLOCKS)
    D = float(plane.mean())
    return _Level(m, D, float(blocks.std()) / math.sqrt(blocks.size) / D if D > 0 else 0.0)


def _parts(levels: list[_Level], powers: tuple[float, ...]) -> list[tuple[float, float]]:
    """Powers and factors of the parts of V, from D at all levels."""
    from scipy.optimize import nnls

    m = np.array([level.passes for level in levels], float)
    D = np.array([max(level.D, 1e-300) for level in levels])
    weight = 1 / (D * np.sqrt([ROUGHNESS**2 + level.error**2 for level in levels]))
    found, _ = nnls(weight[:, None] * m[:, None] ** -np.array(powers), weight * D)
    return [(p, _of_mean(float(c), p)) for p, c in zip(powers, found, strict=True)]


def _power(levels: list[_Level]) -> float:
    """p of D ∝ m⁻ᵖ, by a fit that starts from the usual one."""
    x = np.log([level.passes for level in levels])
    y = np.log([max(level.D, 1e-300) for level in levels])
    weight = 1 / np.array([ROUGHNESS**2 + level.error**2 for level in levels])
    x, y = x - np.average(x, weights=weight), y - np.average(y, weights=weight)
    known = 1 / USUAL_ERROR**2
    p = (known * USUAL - float((weight * x * y).sum())) / (known + float((weight * x * x).sum()))
    return min(max(p, SHRINKING), POWERS[0])


def _of_mean(c: float, p: float) -> float:
    """The factor v of V(n) = v·n⁻ᵖ that belongs to D(m) = c·m⁻ᵖ."""
    return c * 2**p / (2 * (2**p - 1))
