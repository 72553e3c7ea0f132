"""Pictures in so many CPU seconds, and how a choice of automatic mode is told in a table."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.auto.choose import Choice
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.render.planes import beauty_of
from pmviewer.settings.access import Settings, with_values


def picture(renderer: Renderer) -> NDArray[np.float64]:
    """What is rendered so far, (h, w, 3)."""
    return beauty_of(renderer.film.planes()).astype(np.float64)


def silent(text: str, share: float | None) -> None:
    """Nobody listens."""


def rendered(opened: OpenScene, settings: Settings, seconds: float, pool: WorkPool) -> Renderer:
    """Passes for that many CPU seconds, at least one, with kernels compiled and warm."""
    settings = with_values(settings, {"render.passes": 1_000_000})
    prepare(opened, settings, pool, silent)
    renderer = Renderer(opened, settings, pool, StageStore(0))
    while renderer.passes == 0 or (renderer.tally.cpu_seconds < seconds and not renderer.finished):
        renderer.step()
    return renderer


def error_at(cpu: list[float], error: list[float], seconds: float) -> float:
    """Error of a curve after that many CPU seconds, by log-log interpolation, going on with slope −1."""
    if seconds >= cpu[-1]:
        return float(error[-1]) * cpu[-1] / seconds
    return float(math.exp(np.interp(math.log(seconds), np.log(cpu), np.log(error))))


def name_of(choice: Choice) -> str:
    """What was chosen, in a few words."""
    short = choice.name.replace("gather with irradiance cache", "cache")
    changed = choice.changed
    N = f", N {changed['photons.N']:,}" if "photons.N" in changed else ""
    N += f", q {changed['photons.q']:g}" if "photons.q" in changed else ""
    N += f", light samples {changed['direct.samples']}" if "direct.samples" in changed else ""
    radii = {"estimate.radius": ", radius", "estimate.caustic_radius": ", caustic radius"}
    return short + N + "".join(said for path, said in radii.items() if path in changed)


def geometric_mean(values: list[float]) -> float:
    """Of those that are positive and finite, NaN without any."""
    logs = [math.log(value) for value in values if value > 0 and math.isfinite(value)]
    return math.exp(sum(logs) / len(logs)) if logs else math.nan
