"""Automatic mode: relMSE against Mitsuba's path tracer at equal CPU time (P17), against the default and the best of
what it chooses among; and whether it reaches the error that it was asked for and knows what it has reached (P21)."""

from __future__ import annotations

import contextlib
import math
import sys
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench import peer
from pmviewer.bench.measures.error import PEER, Curve, measure_peer, reference
from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.auto.choose import Choice, Goal, choose
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.errors import PmviewerError
from pmviewer.output.metric import relmse
from pmviewer.render.planes import beauty_of
from pmviewer.settings.access import Settings, with_values

QUICK = ("cornell_caustic", "cornell_diffuse", "cornell_glossy", "rooms_10x10", "ring_caustic", "museum", "office")
REST = ("cornell_lights", "colonnade", "corner_room", "glossy_room", "glass_egg", "skylight_room", "three_glasses")
SECONDS, QUICK_SECONDS = 10.0, 4.0
"""CPU seconds, the trial's among them."""
RUN_SCENES = ("cornell_diffuse", "cornell_caustic", "cornell_glossy", "colonnade")
RUNS, QUICK_RUNS = 25, 6
"""With different seeds on each of these scenes."""
SIDE = 64
ASKED = (3e-3, 1e-3)
TRUTH_PASSES = 600
NEAR = 0.3
"""How far from the error that was asked for the one reached may be."""
MOST_PASSES = 3000
CHOSEN = "; how far a trial trusts what it sees of bias was chosen with cornell_caustic among others"
"""SPREAD of `pmviewer.engine.auto.widths`, said in the target's own line."""
CHOSEN_BIAS = "; the least and most that the bias may be were chosen with cornell_caustic"
"""TRUE_BIAS of `pmviewer.engine.auto.estimate`, likewise."""


def _picture(renderer: Renderer) -> NDArray[np.float64]:
    return beauty_of(renderer.film.planes()).astype(np.float64)


def _silent(text: str, share: float | None) -> None:
    """Nobody listens."""


def _until(renderer: Renderer, seconds: float) -> None:
    """Passes for that many CPU seconds, at least one."""
    while renderer.passes == 0 or (renderer.tally.cpu_seconds < seconds and not renderer.finished):
        renderer.step()


def _rendered(opened: OpenScene, settings: Settings, seconds: float, pool: WorkPool) -> tuple[float, Renderer]:
    """relMSE after that many CPU seconds, with kernels compiled and warm."""
    settings = with_values(settings, {"render.passes": 1_000_000})
    prepare(opened, settings, pool, _silent)
    renderer = Renderer(opened, settings, pool, StageStore(0))
    _until(renderer, seconds)
    return relmse(_picture(renderer), reference(opened.scene.name)), renderer


def _at(curve: Curve, seconds: float) -> float:
    """Error of a curve after that many seconds, by log-log interpolation, going on with slope −1."""
    x, y = np.log(curve.cpu), np.log(curve.error)
    if seconds >= curve.cpu[-1]:
        return float(curve.error[-1]) * curve.cpu[-1] / seconds
    return float(math.exp(np.interp(math.log(seconds), x, y)))


def _against(scene: str, seconds: float, pool: WorkPool) -> tuple[list[str | float | int], float]:
    """A row of the table, and the error over Mitsuba's, NaN without it."""
    opened, base = open_scene(scene), Settings()
    choice = choose(opened, base, Goal(seconds=seconds), pool, _silent)
    chosen = with_values(base, dict(choice.values))
    error, renderer = _rendered(opened, chosen, seconds - choice.trial.cpu_seconds, pool)
    default, _ = _rendered(opened, base, seconds, pool)
    ratio = math.nan
    if peer.installed():
        with contextlib.suppress(PmviewerError):  # materials that Mitsuba does not have
            ratio = error / _at(measure_peer(scene, seconds), seconds)
    share = choice.trial.cpu_seconds / seconds
    said = renderer.error.latest
    found = said.relmse if said is not None else math.nan
    return [scene, _name(choice), share, error, choice.expected, found, default, error / default, ratio], ratio


def _name(choice: Choice) -> str:
    short = choice.name.replace("gather with irradiance cache", "cache")
    changed = choice.changed
    N = f", N {changed['photons.N']:,}" if "photons.N" in changed else ""
    radii = {"estimate.radius": ", radius", "estimate.caustic_radius": ", caustic radius"}
    return short + N + "".join(said for path, said in radii.items() if path in changed)


def _runs(scene: str, runs: int, pool: WorkPool) -> tuple[list[str | float | int], list[float], list[bool]]:
    """What came of asking for an error, with different seeds: a row, errors over those asked for, and whether the
    interval covered them."""
    opened = open_scene(scene)
    small = with_values(Settings(), {"camera.width": SIDE, "camera.height": SIDE, "render.passes": MOST_PASSES})
    truth = _truth(opened, small, pool)
    ratios, covered, passes = list[float](), list[bool](), list[int]()
    for run in range(runs):
        asked = ASKED[run % len(ASKED)]
        settings = with_values(small, {"render.seed": 1000 + run, "render.error": asked})
        choice = choose(opened, settings, Goal(error=asked), pool, _silent)
        renderer = Renderer(opened, with_values(settings, dict(choice.values)), pool, StageStore(0))
        renderer.error.bias = choice.bias
        prepare(opened, renderer.settings, pool, _silent)
        while not renderer.finished:
            renderer.step()
        error, said = relmse(_picture(renderer), truth), renderer.error.latest
        assert said is not None
        ratios.append(error / asked)
        covered.append(said.low <= error <= said.high)
        passes.append(renderer.passes)
    near = sum(1 - NEAR <= ratio <= 1 + NEAR for ratio in ratios) / runs
    quantiles = [float(q) for q in np.quantile(ratios, (0.05, 0.5, 0.95))]
    row: list[str | float | int] = [scene, f"{runs} runs asked {ASKED[0]:g}, {ASKED[1]:g}", near, *quantiles]
    return [*row, float(np.mean(passes)), sum(covered) / runs, ""], ratios, covered


def _truth(opened: OpenScene, small: Settings, pool: WorkPool) -> NDArray[np.float64]:
    """A long picture of another seed by plain gathers, small radii."""
    long = with_values(small, {"render.method": "gather", "render.seed": 77, "render.passes": TRUTH_PASSES})
    renderer = Renderer(opened, long, pool, StageStore(0))
    prepare(opened, long, pool, _silent)
    while not renderer.finished:
        renderer.step()
    return _picture(renderer)


def _mean(values: Iterable[float]) -> float:
    """Geometric."""
    logs = [math.log(value) for value in values if value > 0 and math.isfinite(value)]
    return math.exp(sum(logs) / len(logs)) if logs else math.nan


def run(quick: bool = False, scenes: int | None = None) -> BenchResult:
    """Both tables in one: scenes at equal time, then runs that were asked for an error."""
    seconds = QUICK_SECONDS if quick else SECONDS
    names = (QUICK if quick else (*QUICK, *REST))[:scenes]
    pool = WorkPool()
    rows: list[list[str | float | int]] = []
    ratios: list[float] = []
    reached: list[float] = []
    covered: list[bool] = []
    try:
        for name in names:
            row, ratio = _against(name, seconds, pool)
            print(*row, file=sys.stderr, flush=True)
            rows.append(row)
            ratios.append(ratio)
        for name in RUN_SCENES[: 2 if quick else None]:
            row, found, holds = _runs(name, QUICK_RUNS if quick else RUNS, pool)
            print(*row, file=sys.stderr, flush=True)
            rows.append(row)
            reached += found
            covered += holds
    finally:
        pool.close()
    gains = [float(row[7]) for row in rows[: len(names)]]
    targets = [
        Target("auto", _mean(gains), 1.0, "", False, f"relMSE over the default's after {seconds:g} CPU s, mean"),
        Target("auto", max(gains), 1.15, "", False, "the worst scene"),
        Target("P21", _median(reached), 1 + NEAR, "", False, f"error reached over asked, median{CHOSEN}"),
        Target("P21", _median(reached), 1 - NEAR, "", True, "likewise"),
        Target(
            "P21",
            sum(covered) / len(covered),
            0.9,
            "",
            True,
            f"{len(covered)} intervals that cover the truth{CHOSEN_BIAS}",
        ),
    ]
    if any(map(math.isfinite, ratios)):
        known = sum(map(math.isfinite, ratios))
        note = f"relMSE over {PEER}, {peer.variant()}, at {seconds:g} CPU s, the trial counted"
        targets.insert(0, Target("P17", _mean(ratios), 0.08, "", False, f"{note}, geometric mean of {known}"))
        targets.insert(
            1, Target("P17", max(r for r in ratios if math.isfinite(r)), 0.3, "", False, f"{note}, worst scene")
        )
    columns = ["scene", "chosen", "trial / near", "relMSE / 5 %", "expected / median", "estimated / 95 %"]
    columns += ["default / passes", "over default / covered", "over Mitsuba"]
    notes = [
        "scenes: share of the time that the trial took, relMSE, what trial and finished picture promised of it",
        f"runs: share within {NEAR:.0%} of the error asked for, quantiles of reached over asked, passes, share of "
        f"intervals that cover the error; pictures of {SIDE}² against {TRUTH_PASSES} passes of the final gather",
    ]
    return BenchResult("Automatic mode", columns, rows, targets, notes)


def _median(values: list[float]) -> float:
    return float(np.median(values)) if values else math.nan
