"""Guided emission (I6): how many photons leave each stratum of the lights, and with which power, by what test photons
met.

Test photons are a sixteenth or an eighth of all. q_s is the stratum's share of the emitted power, I_s the mean
importance that test photons from it met, known from those of this pass and of the passes before (`estimated`); powers
are in units of Φ/N. What a test photon met is taken from its first diffuse surface: the importance of that place to
photons that go on from there (`pmviewer.photons.emission.scattered`) tells more than the one way on that it took. For n
photons the error of the picture, Σ q²·I/(n·p), is least where they leave with probabilities p ∝ q·√I.

**Peter-Pietrek** (1998). Test photons are not stored. Photons leave stratum s with the probability
p_s = (1 − δ)·q_s·√I_s/Σ q·√I + δ·q_s, of n in all, and have the power q_s·N/(n·p_s), never more than N/(δ·n). (Peter
and Pietrek take I itself. With it each stratum that matters at all, however little, brings as much of the error as any
other.)

**Christensen discard** (course guide, §5.7.4). Strata whose test photons, and those of the strata beside, met nothing
important keep them as their photons, unless I_s asks for more than there are. Of the others test photons are dropped
and n photons emitted, p_s ∝ q_s·√I_s but ENOUGH times as many as test photons, with the power q_s·N/(n·p_s).

**Christensen keep.** No test photon is dropped. There are two sets, A and B, of h photons a stratum. Set A says how
many photons the stratum should have, and a photon of set B gets the power q_s·N/M_s^A, and the other way round. M_s ∝
q_s·√I_s, but never less than q_s·N/MOST_WEIGHT and 2h: no photon has more than MOST_WEIGHT times the power of an
unguided one. What is missing, W_s = q_s·(1 − h/M_s^A − h/M_s^B), is topped up by n photons, p_s ∝ W_s·M_s/q_s, of power
W_s·N/(n·p_s).

In both no photon has more power than test photons do, those of refined strata have less the more they matter, and what
arrives at one place from strata of different importance differs by the root of that.

**Splitting.** A photon's power is about κ/√I, I being that of its stratum. More important places that it comes to
by chance, through a door, ask for less: there it goes on in pieces (`pmviewer.photons.emission.window`).

**Bias.** What decides about a photon's power must not know where that photon went. Peter-Pietrek's test photons, those
of earlier passes, and in Christensen keep those of the other set, are independent of it: both are exact in the mean.
The price is a rare photon of high power that reaches an important place though no test photon did. In Christensen
discard there is none, by construction, and with them the light is missing that they would have brought: paths that only
1 in many photons of a stratum take count with the probability that test photons of this pass or an earlier one find
them. Emitted power is Φ in the mean with all.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pmviewer.photons.emission.light_importance import LightImportance
from pmviewer.photons.emission.strata import Strata, StrataTable, strata_of, table_of
from pmviewer.photons.emission.tested import Runner, Sought, Tested, TraceBatch, trace_tests, weighed
from pmviewer.photons.emission.window import Window
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.state import State

Variant = Literal["Peter-Pietrek", "Christensen discard", "Christensen keep"]
Float = NDArray[np.float64]

DEFENSIVE = 0.1
"""δ."""
ENOUGH = 2.0
"""Photons at least, relative to its test photons, that replace them in a stratum."""
MOST_WEIGHT = 4.0
"""Most power of a photon of Christensen keep, relative to that of an unguided one. A fourth of the photons at most go
where nothing is known to matter for that; the test photons alone, an eighth, would have 8."""
SCALES = (4, 1)
"""Blurs of growing sharpness in which importance is estimated, between the whole light and the stratum itself."""
PRIOR = 2.0
"""Test photons that the coarser estimate counts for in the finer one."""
TEST_SHARE = {"Peter-Pietrek": 1 / 16, "Christensen discard": 1 / 8, "Christensen keep": 1 / 8}
"""Most test photons of a pass relative to all its photons."""


@dataclass(frozen=True)
class Guidance:
    """What guided emission is asked for: at least `tests` test photons a stratum, and `important`, the importance
    (0 … 1) from which a place is important to the discard variant. `window` is the importance of places to photons that
    go on from there, by which they are split (`pmviewer.photons.emission.window`)."""

    variant: Variant
    sought: Sequence[Sought]
    tests: int
    important: float
    window: Window | None = None


@dataclass(frozen=True, eq=False)
class Known:
    """Of each stratum (n,): the importance that its test photons met, their number, and how many met an important
    place."""

    met: Float
    tests: Float
    hits: Float

    def __add__(self, other: Known) -> Known:
        return Known(self.met + other.met, self.tests + other.tests, self.hits + other.hits)

    def state(self) -> State:
        """All of it."""
        return State({}, {"met": self.met, "tests": self.tests, "hits": self.hits})

    @staticmethod
    def restored(state: State) -> Known:
        """From what `state` has told. Raises ValueError for anything else."""
        n = len(state.array("met", (None,), np.float64))
        return Known(*(state.array(name, (n,), np.float64) for name in ("met", "tests", "hits")))


@dataclass(frozen=True, eq=False)
class Guided:
    """The emission of one pass of N trajectories: `tested` test photons and n by the table. `kept` are batches of test
    photons to be stored, `smallest` the power of photons that head for the most important places, in units of Φ/N.
    `rays` and `dropped` photons are those of the test photons; `notes` sentences for the log. `known` is what the test
    photons of this pass and the earlier ones met."""

    table: StrataTable
    n: int
    N: int
    tested: int
    kept: list[Any]
    smallest: float
    lights: LightImportance
    rays: int
    dropped: int
    known: Known
    notes: tuple[str, ...] = ()


def guided_emission(
    scene: FlatScene,
    guidance: Guidance,
    seed: int,
    N: int,
    size: int,
    trace: TraceBatch,
    run: Runner,
    before: Known | None = None,
) -> Guided | None:
    """The emission of a pass of N trajectories, test photons included. None where they are too few to test all lights.

    size: test photons a task; trace: see `pmviewer.photons.emission.tested`; before: what those of earlier passes met.
    """
    most = int(TEST_SHARE[guidance.variant] * N)
    strata = strata_of(scene, most // max(2, guidance.tests))
    if strata is None:
        return None
    each = most // strata.n // 2 * 2
    sought = _asked_of_tests(guidance)
    folds = [trace_tests(strata, each // 2, fold, seed, size, trace, sought, run) for fold in (0, 1)]
    nothing = Known(*np.zeros((3, strata.n)))
    sets = [known_of(strata, tests, guidance.important) for tests in folds]
    tested, before = each * strata.n, before or nothing
    known, n = before + sets[0] + sets[1], N - tested
    h = each // 2
    if guidance.variant == "Peter-Pietrek":
        share, weight, powers = peter_pietrek(strata, known, n, N)
    elif guidance.variant == "Christensen discard":
        share, weight, powers = discard(strata, known, h, n, N)
    else:
        share, weight, powers = keep(strata, before + sets[0], before + sets[1], h, n, N)
    kept = [
        task
        for fold, (tests, of_strata) in enumerate(zip(folds, powers, strict=True))
        if of_strata.any()
        for task in weighed(tests, strata, np.tile(of_strata, h), seed + fold)
    ]
    notes: tuple[str, ...] = ()
    if not known.met.any():
        notes = (
            f"Guided emission: none of {tested:,} test photons met an important place, so photons leave the lights by "
            "power. More photons (photons.N) may find a way.",
        )
    used, kappa = weight[share > 0], _kappa(strata, known, weight)
    return Guided(
        table=table_of(
            strata,
            share if share.any() else strata.power,
            weight,
            guidance.window if kappa > 0 else None,
            1 / kappa if kappa > 0 else 0.0,
        ),
        n=n if share.any() else 0,
        N=N,
        tested=tested,
        kept=kept,
        smallest=float(used.min()) if len(used) else 1.0,
        lights=_of_lights(scene, strata, share, known, n, each),
        rays=sum(tests.rays for tests in folds),
        dropped=sum(tests.dropped for tests in folds),
        known=known,
        notes=notes,
    )


def _kappa(strata: Strata, known: Known, weight: Float) -> float:
    """κ: the mean of power × √I over what strata bring to the picture, so that those that bring little, whose power is
    bounded, don't tell. 0 where nothing was met."""
    met = np.where(weight > 0, estimated(strata, known), 0.0)
    brought = strata.power * met
    return float((brought * weight * np.sqrt(met)).sum() / brought.sum()) if brought.any() else 0.0


def _asked_of_tests(guidance: Guidance) -> list[Sought]:
    """What test photons are asked for: which places are important concerns the discard variant alone, and look-ups of
    importance where there is none are dear."""
    if guidance.variant == "Christensen discard":
        return list(guidance.sought)
    return [replace(goal, places=0) for goal in guidance.sought if goal.classes]


Decision = tuple[Float, Float, tuple[Float, Float]]
"""Of each stratum (n,): share of the trajectories to be traced, in all 1 or nothing; power of these photons; powers of
the test photons of both sets, 0 for those that are dropped."""


def known_of(strata: Strata, tests: Tested, important: float) -> Known:
    """What one set of test photons met; a place of importance `important` is important."""
    h = np.full(strata.n, tests.n / strata.n)
    hits = (tests.most >= important).astype(np.float64)
    return Known(tests.met.reshape(-1, strata.n).sum(axis=0), h, hits.reshape(-1, strata.n).sum(axis=0))


def peter_pietrek(strata: Strata, known: Known, n: int, N: int) -> Decision:
    """n photons by what is known."""
    q, none = strata.power, np.zeros(strata.n)
    wanted = q * _root(estimated(strata, known))
    share = (1 - DEFENSIVE) * wanted / wanted.sum() + DEFENSIVE * q
    return share, _powers(q, share, n, N), (none, none)


def discard(strata: Strata, known: Known, h: int, n: int, N: int) -> Decision:
    """Test photons of strata without hits, n others from the rest."""
    q, none = strata.power, np.zeros(strata.n)
    asked = q * _root(estimated(strata, known))
    asked *= n / asked.sum()
    refined = (beside(strata, known.hits) > 0) | (asked > 2 * h)
    if not refined.any():
        return q.copy(), np.full(strata.n, N / n), (none, none)
    share = np.where(refined, np.maximum(asked, ENOUGH * 2 * h), 0.0)
    share /= share.sum()
    of_tests = np.where(refined, 0.0, q * N / (2 * h))
    return share, _powers(q, share, n, N), (of_tests, of_tests)


def keep(strata: Strata, a: Known, b: Known, h: int, n: int, N: int) -> Decision:
    """Test photons of set A by what is known without them, `b`, and the other way round; n photons on top."""
    q, asked = strata.power, []
    least = np.maximum(q * N / MOST_WEIGHT, 2 * h)
    for known in (a, b):
        asked.append(_at_least(q * _root(estimated(strata, known)), least, n + 2 * h * strata.n))
    missing = np.maximum(q * (1 - h / asked[0] - h / asked[1]), 0.0)
    missing[missing < 1e-9 * q] = 0.0
    share = missing / (q * (1 / asked[0] + 1 / asked[1]))
    if share.any():
        share /= share.sum()
    return share, _powers(missing, share, n, N), (q * N / asked[1], q * N / asked[0])


def _at_least(wanted: Float, least: Float, total: float) -> Float:
    """Numbers ∝ `wanted`, but not below `least`, that sum to `total`, or all `least` where those do not fit."""
    numbers, free = least.copy(), wanted > 0
    while free.any():
        rest = total - least[~free].sum()
        numbers = np.where(free, wanted * (rest / wanted[free].sum()), least)
        short = free & (numbers < least)
        if not short.any():
            break
        free &= ~short
    return np.maximum(numbers, least)


def _root(value: Float) -> Float:
    """√I relative to its largest; 1 everywhere if nothing was met at all."""
    largest = float(value.max(initial=0.0))
    return np.sqrt(value / largest) if largest > 0 else np.ones_like(value)


def estimated(strata: Strata, known: Known) -> Float:
    """I_s: the mean over all, made sharper by that over the light, that over the strata around s, and s itself, as far
    as these have the test photons to tell."""
    met, tests = known.met, known.tests
    n_lights = len(strata.first)
    all_met, all_tests = np.bincount(strata.light, met, n_lights), np.bincount(strata.light, tests, n_lights)
    value = ((all_met + PRIOR * met.sum() / tests.sum()) / (all_tests + PRIOR))[strata.light]
    for scale in SCALES:
        around, number = beside(strata, met, scale), beside(strata, tests, scale)
        value = (around + PRIOR * value) / (number + PRIOR)
    return np.asarray((met + PRIOR * value) / (tests + PRIOR), np.float64)


def beside(strata: Strata, values: Float, width: int = 1) -> Float:
    """Sums over the strata of the same light around each stratum, `width` steps of a blur wide; (strata,). Its own
    value counts once, those beside less and less."""
    out = np.empty(strata.n)
    for cells in np.unique(strata.cells, axis=0):
        lights = np.flatnonzero((strata.cells == cells).all(axis=1))
        where = (strata.first[lights][:, None] + np.arange(cells.prod())).ravel()
        block, middle = values[where].reshape(len(lights), *cells), 1.0
        for axis in range(1, 5):
            if block.shape[axis] > 1:
                block = _blurred(block, axis, width)
                middle *= math.comb(2 * width, width) / 4**width
        out[where] = block.ravel() / middle
    return out


def _blurred(block: Float, axis: int, width: int) -> Float:
    """Binomial weights along the axis, of sum 1 but at the ends."""
    block = np.moveaxis(block, axis, 0)
    for _ in range(width):
        total = 0.5 * block
        total[1:] += 0.25 * block[:-1]
        total[:-1] += 0.25 * block[1:]
        block = total
    return np.moveaxis(block, 0, axis)


def _powers(power: Float, share: Float, n: int, N: int) -> Float:
    """Of each stratum's photons in units of Φ/N, when n of them carry its `power` with probabilities `share`."""
    return np.divide(power * N, n * share, out=np.zeros_like(power), where=share > 0)


def _of_lights(scene: FlatScene, strata: Strata, share: Float, known: Known, n: int, each: int) -> LightImportance:
    n_lights = len(scene.light_names)

    def summed(values: Float) -> Float:
        return np.bincount(strata.light, values, n_lights).astype(np.float64)

    trajectories, mean = summed(n * share + each), summed(known.met) / summed(known.tests)
    return LightImportance(
        names=scene.light_names,
        share=trajectories / trajectories.sum(),
        power=summed(strata.power),
        met=mean / mean.max() if mean.any() else mean,
    )
