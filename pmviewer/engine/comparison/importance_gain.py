"""What importance buys: the same picture with importance and without, at as many stored photons or at the same error.

Without importance every photon is stored and emission is plain. Its N is such that a pass stores as many photons as one
with importance does. At equal error, passes are then added until the error is that with importance. Errors are measured
against a reference that the caller gives, or else against a longer run without importance of another seed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.comparison.without_importance import plain, refusal
from pmviewer.engine.frame import Frame
from pmviewer.engine.inspection import Wanted
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.errors import SettingError
from pmviewer.output.metric import Metrics, metrics
from pmviewer.settings.access import SETTINGS, Settings, with_values

Tell = Callable[[str, float | None], None]
Truth = tuple[NDArray[np.float32], str]
"""An image (h, w, 3) and its name."""

LONGER = 4
"""Passes of the run that tells the error, over those with importance."""
KEPT = 1 << 28
"""Bytes that a run's stage store may keep: what serves all its passes."""
PROBE = 50_000
"""Trajectories that tell how many photons one stores without importance."""
STEP = 1.1
"""At equal error the error is measured whenever passes have grown by this factor."""


@dataclass(frozen=True)
class Side:
    """One of the two pictures: its settings' `N`, sums over all passes of photons `traced` and `stored` and of CPU
    seconds, bytes of photon maps and importance maps in the last pass."""

    frame: Frame
    N: int
    passes: int
    traced: int
    importons: int
    stored: int
    map_bytes: int
    importance_bytes: int
    cpu_seconds: float
    error: Metrics


@dataclass(frozen=True)
class Gain:
    """Both pictures, `equal` in one thing; `truth` says what errors are against, `notes` what to know besides."""

    with_: Side
    without: Side
    equal: Literal["photons", "error"]
    truth: str
    notes: tuple[str, ...] = ()

    def frames(self) -> tuple[Frame, Frame]:
        """The picture with importance and that without."""
        return self.with_.frame, self.without.frame

    def table(self) -> list[tuple[str, str, str, str]]:
        """`rows` under their heading."""
        return [(self.heading, "with importance", "without", "without / with"), *self.rows()]

    @property
    def heading(self) -> str:
        """What is equal."""
        if self.equal == "photons":
            return "equal stored photons" if not self.notes else "photons stored differ"
        return "equal error" if self.without.error.relmse_all <= self.with_.error.relmse_all else "error not reached"

    def sentences(self) -> list[str]:
        """What errors are against, and what to know besides."""
        return [f"Errors are against {self.truth}.", *self.notes]

    def rows(self) -> list[tuple[str, str, str, str]]:
        """What, with importance, without, and the latter over the former."""
        a, b = self.with_, self.without

        def count(title: str, x: float, y: float, text: Callable[[float], str]) -> tuple[str, str, str, str]:
            return title, text(x), text(y), f"{y / x:.2f} ×" if x > 0 and math.isfinite(y) else "–"

        def whole(value: float) -> str:
            return f"{value:,.0f}"

        return [
            count("photons stored", a.stored, b.stored, whole),
            count("relMSE", a.error.relmse_all, b.error.relmse_all, lambda e: f"{e:.3e}"),
            count("CPU time", a.cpu_seconds, b.cpu_seconds, lambda s: f"{s:.2f} s"),
            count("photons traced", a.traced, b.traced, whole),
            count("passes", a.passes, b.passes, whole),
            count("trajectories a pass, N", a.N, b.N, whole),
            count("photon maps of a pass", a.map_bytes, b.map_bytes, _size),
            ("importance maps", _size(a.importance_bytes), "–", ""),
            ("importons traced", whole(a.importons), "–", ""),
            ("mean over the true one", f"{a.error.mean_ratio:.4f}", f"{b.error.mean_ratio:.4f}", ""),
        ]


def _size(count: float) -> str:
    return f"{count / 1024:,.0f} KiB" if count < 1 << 24 else f"{count / (1 << 20):,.1f} MiB"


def compare(opened: OpenScene, settings: Settings, pool: WorkPool, tell: Tell, truth: Truth | None = None) -> Gain:
    """Render both pictures by `settings.compare`. `tell(text, share)` hears of each pass; `truth` is an image of what
    the settings' camera sees.

    Raises SettingError where there is nothing to compare, Cancelled when the pool is cancelled.
    """
    why = refusal(settings, opened.traits)
    if why is not None:
        raise SettingError(f"No comparison: {why}")
    asked = settings.compare
    calm = with_values(settings, {"render.passes": 1_000_000, "render.time_limit": 0.0, "display.view": "beauty"})
    notes: list[str] = []
    for each in (calm, plain(calm)):
        prepare(opened, each, pool, lambda text, share: tell(text, 0.0))

    with_ = Renderer(opened, calm, pool, StageStore(KEPT))
    _passes(with_, asked.passes, "with importance", tell, 0.0, 0.3)
    stored = sum(with_.tally.stored.values())
    if stored == 0:
        raise SettingError("No comparison: with importance no photon is stored.")

    if truth is None:
        tell("measuring the error", 0.3)
        truth = _longer(opened, plain(calm), asked.passes, pool, tell)
    target = truth[0]

    N, note = _equal_N(opened, plain(calm), stored, asked.passes, pool)
    notes += note
    without = Renderer(opened, with_values(plain(calm), {"photons.N": N}), pool, StageStore(KEPT))
    error = metrics(_image(with_), target)
    if asked.equal == "photons":
        _passes(without, asked.passes, "without importance", tell, 0.7, 0.3)
    else:
        notes += _until(without, error.relmse_all, target, asked.passes, asked.limit, tell)
    tell("finished", 1.0)
    sides = _side(with_, error), _side(without, metrics(_image(without), target))
    return Gain(*sides, asked.equal, truth[1], tuple(notes))


def _image(renderer: Renderer) -> NDArray[np.float32]:
    return renderer.frame(0, Wanted()).image()


def _passes(renderer: Renderer, count: int, what: str, tell: Tell, start: float, share: float) -> None:
    while renderer.passes < count:
        tell(f"{what}, pass {renderer.passes + 1} of {count}", start + share * renderer.passes / count)
        renderer.step()


def _longer(opened: OpenScene, settings: Settings, passes: int, pool: WorkPool, tell: Tell) -> Truth:
    """A picture that both are measured against where no reference fits."""
    other = with_values(settings, {"render.seed": (settings.render.seed + 1) % 2**31})
    renderer = Renderer(opened, other, pool, StageStore(KEPT))
    count = LONGER * passes
    _passes(renderer, count, "a longer run for the error", tell, 0.3, 0.4)
    name = (
        f"a run of {count} passes without importance, N = {settings.photons.N:,}, another seed (its own error included)"
    )
    return _image(renderer), name


def _equal_N(opened: OpenScene, settings: Settings, stored: int, passes: int, pool: WorkPool) -> tuple[int, list[str]]:
    """N that stores `stored` photons in `passes` passes without importance, and what to know of it."""
    tiny = {"camera.width": 8, "camera.height": 8, "photons.N": min(settings.photons.N, PROBE)}
    probe = Renderer(opened, with_values(settings, tiny), pool, StageStore(KEPT))
    probe.step()
    found = sum(probe.tally.stored.values())
    if found == 0:
        raise SettingError("No comparison: without importance no photon is stored.")
    kept = settings.photons.renew == "once"
    wanted = stored / (1 if kept else passes) * tiny["photons.N"] / found
    lower, upper = SETTINGS["photons.N"].lower or 1, SETTINGS["photons.N"].upper or math.inf
    N = round(min(max(wanted, lower), upper))
    if not lower <= wanted <= upper:
        return N, [f"As many photons would need N = {wanted:,.0f}, which is out of bounds: photon counts differ."]
    return N, []


def _until(
    renderer: Renderer, error: float, truth: NDArray[np.float32], passes: int, limit: float, tell: Tell
) -> list[str]:
    """Add passes until the error is at most that, or there are `limit` times `passes`; a sentence if it is not
    reached."""
    most = max(1, round(limit * passes))
    mark, found = 1, math.inf
    while renderer.passes < most:
        done = f"relMSE {found:.2e}, wanted {error:.2e}" if renderer.passes else "first pass"
        share = 0.7 + 0.3 * renderer.passes / most
        tell(f"without importance, pass {renderer.passes + 1} of at most {most}: {done}", share)
        renderer.step()
        if renderer.passes >= min(mark, most):
            mark = max(renderer.passes + 1, math.ceil(renderer.passes * STEP))
            found = metrics(_image(renderer), truth).relmse_all
            if found <= error:
                return []
    return [f"Without importance the error was not reached in {most} passes (compare.limit): it would cost more."]


def _side(renderer: Renderer, error: Metrics) -> Side:
    tally, maps = renderer.tally, renderer.importance.latest
    return Side(
        frame=replace(renderer.frame(0, Wanted()), clouds={}),  # photons are not compared
        N=renderer.settings.photons.N,
        passes=renderer.passes,
        traced=tally.emitted,
        importons=maps.traced if maps is not None else 0,
        stored=sum(tally.stored.values()),
        map_bytes=tally.map_bytes,
        importance_bytes=maps.bytes if maps is not None else 0,
        cpu_seconds=tally.cpu_seconds,
        error=error,
    )
