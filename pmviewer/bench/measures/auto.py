"""Automatic mode: relMSE against Mitsuba's path tracer at equal CPU time (P17), against the default and the best of
what it chooses among; and whether it reaches the error that it was asked for and knows what it has reached (P21)."""

from __future__ import annotations

import contextlib
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench import peer
from pmviewer.bench.measures.auto_files import CHOSEN as CHOSEN_FILES
from pmviewer.bench.measures.auto_files import RATIO as FILE_RATIO
from pmviewer.bench.measures.auto_files import on_files, over_peer
from pmviewer.bench.measures.error import measure_peer, reference, reference_noise
from pmviewer.bench.measures.timed import error_at, geometric_mean, name_of, picture, rendered, silent
from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.auto.choose import Choice, Goal, choose
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.errors import PmviewerError
from pmviewer.output.metric import relmse
from pmviewer.settings.access import Settings, with_values

QUICK = ("cornell_caustic", "cornell_diffuse", "cornell_glossy", "rooms_10x10", "ring_caustic", "museum", "office")
REST = ("cornell_lights", "colonnade", "corner_room", "glossy_room", "glass_egg", "skylight_room", "three_glasses")
SECONDS, QUICK_SECONDS = 10.0, 4.0
"""CPU seconds, the trial's among them."""
REAL = 10
"""Files of other people's, at least, that P17 counts together with the bundled scenes."""
RUN_SCENES = ("cornell_diffuse", "cornell_caustic", "cornell_glossy", "colonnade")
RUNS, QUICK_RUNS = 25, 6
"""With different seeds on each of these scenes."""
SIDE = 64
ASKED = (3e-3, 1e-3)
TRUTH_PASSES = 600
NEAR = 0.3
"""How far from the error that was asked for the one reached may be."""
MOST_PASSES = 3000
LEAST_KNOWN = 0.1
"""Of the noise of a reference: errors below that are not told by it."""
CHOSEN = (
    "; what a trial takes bias relative to, how far it trusts it, how noise is taken to fall, that fewer photons need "
    "not promise less, and how few light samples are preferred, was chosen with cornell_caustic too"
)
"""The denominator and SPREAD of `pmviewer.engine.auto.widths`, the powers and EVEN of `pmviewer.engine.auto.model`, the
powers of `measured`, and where FEWER_PHOTONS of `choose` does not count, said in the target's own line."""
CHOSEN_WAYS = (
    "; what every way of such scenes has, such as caustics of lights alone and photons' roulette, light samples with "
    "several lights, the choice of lights by distance, how noise is taken to fall, how wide radii that wait may be, "
    "what photons shown directly have to promise, how few light samples are preferred, and how many photons look-ups "
    "of maps that are shown hold at first were chosen with these scenes too, and how wide gather rays' look-ups are "
    "where photons lie far apart with four of them, how the covered part of discs is told with cornell_diffuse, and "
    "what bias noise may hide with four of them"
)
"""CHANNEL_ROULETTE, LIGHTS_CAUSTICS, THICKER and WIDE_RECORDS of `pmviewer.engine.auto.candidates`, SEVERAL of
`pmviewer.render.direct.samples`, the automatic `direct.choice`, the powers and EVEN of `pmviewer.engine.auto.model`,
those of `measured`, that its radii are as wide for a time as for an error, SHOWN of `candidates`, HELD and CAUSTIC_HELD
of `pmviewer.engine.stages.spread`, and HELD and MOST of `pmviewer.engine.auto.sparse`, likewise."""
CHOSEN_SEEN = ", and what the estimate takes a pixel's error relative to, with these scenes among others"
CHOSEN_BIAS = f"; the least and most that the bias may be were chosen with cornell_caustic{CHOSEN_SEEN}"
"""Which of six ways a pixel is seen through its noise, and TRUE_BIAS of `pmviewer.engine.auto.estimate`, likewise."""


def without_noise(error: float, noise: float) -> float:
    """A relMSE against a reference of that noise, which is independent of the picture and adds up with its error: less
    it, but no less than `LEAST_KNOWN` of it, below which the reference tells nothing."""
    return max(error - noise, LEAST_KNOWN * noise)


def _error(renderer: Renderer, scene: str) -> float:
    return without_noise(relmse(picture(renderer), reference(scene)), reference_noise(scene))


def _ratio(scene: str, error: float, seconds: float) -> float:
    """That error over Mitsuba's, without the reference's noise; NaN without Mitsuba, or where it lacks a material."""
    if peer.installed():
        with contextlib.suppress(PmviewerError):
            curve = measure_peer(scene, seconds)
            theirs = [without_noise(one, reference_noise(scene)) for one in curve.error]
            return error / error_at(curve.cpu, theirs, seconds)
    return math.nan


def _with_choice(scene: str, seconds: float, pool: WorkPool) -> tuple[OpenScene, Choice, Renderer]:
    """The scene, what automatic mode chose for that time, and what it rendered in the rest of it."""
    opened, base = open_scene(scene), Settings()
    choice = choose(opened, base, Goal(seconds=seconds), pool, silent)
    chosen = with_values(base, dict(choice.values))
    return opened, choice, rendered(opened, chosen, seconds - choice.trial.cpu_seconds, pool)


def _against(scene: str, seconds: float, pool: WorkPool) -> tuple[list[str | float | int], float]:
    """A row of the table, and the error over Mitsuba's, NaN without it, both without the reference's noise."""
    opened, choice, renderer = _with_choice(scene, seconds, pool)
    error, default = _error(renderer, scene), _error(rendered(opened, Settings(), seconds, pool), scene)
    ratio = _ratio(scene, error, seconds)
    share = choice.trial.cpu_seconds / seconds
    said = renderer.error.latest
    found = said.relmse if said is not None else math.nan
    row: list[str | float | int] = [scene, name_of(choice), share, error, choice.expected, found, default]
    return [*row, error / default, ratio, reference_noise(scene)], ratio


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
        choice = choose(opened, settings, Goal(error=asked), pool, silent)
        renderer = Renderer(opened, with_values(settings, dict(choice.values)), pool, StageStore(0))
        renderer.error.bias = choice.bias
        prepare(opened, renderer.settings, pool, silent)
        while not renderer.finished:
            renderer.step()
        error, said = relmse(picture(renderer), truth), renderer.error.latest
        assert said is not None
        ratios.append(error / asked)
        covered.append(said.low <= error <= said.high)
        passes.append(renderer.passes)
    near = sum(1 - NEAR <= ratio <= 1 + NEAR for ratio in ratios) / runs
    quantiles = [float(q) for q in np.quantile(ratios, (0.05, 0.5, 0.95))]
    row: list[str | float | int] = [scene, f"{runs} runs asked {ASKED[0]:g}, {ASKED[1]:g}", near, *quantiles]
    return [*row, float(np.mean(passes)), sum(covered) / runs, "", ""], ratios, covered


def _truth(opened: OpenScene, small: Settings, pool: WorkPool) -> NDArray[np.float64]:
    """A long picture of another seed by plain gathers, small radii."""
    long = with_values(small, {"render.method": "gather", "render.seed": 77, "render.passes": TRUTH_PASSES})
    renderer = Renderer(opened, long, pool, StageStore(0))
    prepare(opened, long, pool, silent)
    while not renderer.finished:
        renderer.step()
    return picture(renderer)


def _with_bundled(files: BenchResult, seconds: float) -> BenchResult:
    """What P17 says of files and bundled scenes together, put before what it says of files alone."""
    known: dict[str, float] = {}
    pool = WorkPool()
    try:
        for name in (*QUICK, *REST):
            _, _, renderer = _with_choice(name, seconds, pool)
            ratio = _ratio(name, _error(renderer, name), seconds)
            print(name, ratio, file=sys.stderr, flush=True)
            if math.isfinite(ratio):
                known[name] = ratio
    finally:
        pool.close()
    ratios = [*known.values(), *(float(row[FILE_RATIO]) for row in files.rows)]
    what = f"{len(known)} bundled scenes, less the references' noise, and {len(files.rows)} files"
    targets = over_peer(ratios, seconds, what, CHOSEN_WAYS + CHOSEN_FILES)
    said = ", ".join(f"{name} {ratio:.3g}" for name, ratio in known.items())
    return replace(files, targets=[*targets, *files.targets], notes=[*files.notes, f"bundled scenes: {said}"])


def run(quick: bool = False, scenes: int | None = None, folder: Path | None = None, seed: int = 1) -> BenchResult:
    """Both tables in one: scenes at equal time, then runs that were asked for an error. With a `folder` the Mitsuba
    files below it instead, or so many `scenes` of them, drawn by `seed`, at equal time; if not quick and there are
    `REAL` of them, together with the bundled scenes, as P17 counts."""
    seconds = QUICK_SECONDS if quick else SECONDS
    if folder is not None:
        files = on_files(folder, seconds, scenes, seed)
        return files if quick or len(files.rows) < REAL else _with_bundled(files, seconds)
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
        Target(
            "auto", geometric_mean(gains), 1.0, "", False, f"relMSE over the default's after {seconds:g} CPU s, mean"
        ),
        Target("auto", max(gains), 1.15, "", False, "the worst scene"),
        Target("P21", _median(reached), 1 + NEAR, "", False, f"error reached over asked, median{CHOSEN}{CHOSEN_SEEN}"),
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
    known = [ratio for ratio in ratios if math.isfinite(ratio)]
    if known:
        targets = [
            *over_peer(known, seconds, f"{len(known)} scenes, less the references' noise", CHOSEN_WAYS),
            *targets,
        ]
    columns = ["scene", "chosen", "trial / near", "relMSE / 5 %", "expected / median", "estimated / 95 %"]
    columns += ["default / passes", "over default / covered", "over Mitsuba", "reference's noise"]
    notes = [
        "errors of scenes are without the noise of their references, which is the same for all pictures of a scene",
        "scenes: share of the time that the trial took, relMSE, what trial and finished picture promised of it",
        f"runs: share within {NEAR:.0%} of the error asked for, quantiles of reached over asked, passes, share of "
        f"intervals that cover the error; pictures of {SIDE}² against {TRUTH_PASSES} passes of the final gather",
    ]
    return BenchResult("Automatic mode", columns, rows, targets, notes)


def _median(values: list[float]) -> float:
    return float(np.median(values)) if values else math.nan
