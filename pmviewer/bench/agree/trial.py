"""One scene, every method: what is compared with what, and how often again before it counts as a disagreement.

* `path` with Mitsuba's path tracer: the picture, and what paths of one scattering bring (emission and direct light).
* The photon methods with Mitsuba's path tracer. Where lights of one point or direction shine on smooth mirrors, glass
  or coats, no path tracer finds the caustics. There they are compared with Mitsuba's particle tracer instead, in the
  pixels that see nothing of the kind; with each other where no such pixel is left, where lights at infinity shine,
  which Mitsuba's particles show wrong, or where these bring less than its own paths.
* Of scenes whose glass disperses, which Mitsuba's RGB variants don't know, the photon methods with our `path` alone, in
  the terms of the first surface: what is seen through glass mixes channels by photons, wavelengths by paths.
* Of scenes with media that emit, which Mitsuba 3 does not know (3.9.1 refuses the property), the photon methods with
  our `path` alone, the picture and all terms.
* With thin glass, `gather` with panes that light passes straight (`render.thin_glass`), as the photon methods.
* The photon methods with our `path`, term by term: with such caustics only what the camera sees without them.

Photon methods are consistent: what their look-ups blur or lose at edges goes with the radius r. A disc over a straight
edge loses on average a fifth of its light in a strip r wide; of a surface as wide as the scene's radius R, with two
edges, that is some 0.4 r/R, of one a tenth as wide 4 r/R, which is forgiven. The radius is halved for each stage of
fresh seeds, so that a true error stays and what is forgiven goes. Where more is left in the last stage, as in a block
where a bright and a dark surface meet, the limit for r = 0 counts, twice the last stage less the one before.

Virtual lights are photon methods, too: their caustics are looked up. Their plain sum has no other bias; its spikes have
no variance, which the test allows for (SPIKES). Weighted light is a quotient C·ΣF/ΣG, whose bias falls slowly where
single lights rule ΣG, too slowly for a test. What it is made of has none: ΣF is compared as a picture, and ΣG with ΣC,
which gathering walks count: both have the same mean, of a single step with many photons (docs/virtual.md). Of these
estimators a scene has at most one; whole paths weigh nothing in media.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.agree.generate import disperses, has_distant_lights, needs_particles
from pmviewer.bench.agree.known import WALKS
from pmviewer.bench.agree.media import emits, has_media
from pmviewer.bench.agree.mitsuba_client import Mitsuba, MitsubaError
from pmviewer.bench.agree.ours import (
    METHODS,
    PHOTON_METHODS,
    THIN_GLASS,
    VIRTUAL,
    WEIGHTED,
    Effort,
    our_runs,
    picture,
    term,
)
from pmviewer.bench.agree.shares import asked_methods, asks_one_scattering
from pmviewer.bench.agree.statistics import CHANNELS, SPIKES, TAIL, Outcome, compared, negligible, summaries
from pmviewer.bench.agree.tree import Node
from pmviewer.bench.agree.verdict import Comparison, Verdict
from pmviewer.bench.agree.xml import write_scene
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.errors import PmviewerError
from pmviewer.scene.arrays.flatten import SURFACES, flatten
from pmviewer.settings.access import Settings

STAGES = (
    Effort(runs=6, spp=8, passes=2, photons=8_000, radius=0.01),
    Effort(runs=6, spp=8, passes=2, photons=8_000, radius=0.01, adds=True),
    Effort(runs=12, spp=8, passes=2, photons=8_000, radius=0.01, adds=True),
    Effort(runs=16, spp=32, passes=6, photons=20_000, radius=0.005),
    Effort(runs=24, spp=64, passes=10, photons=60_000, radius=0.0025),
)
"""Nearly all agree at the first look. It and the second pass on whatever is not plainly equal, so that the third, which
has all runs of the three, decides what is found: it has an even chance to find 4.1 of its standard errors, which are 7
of the path tracers' fourth and 12 of their last. The others need no more than to tell that."""
FIRST = 2
"""The last stage of those that look at the same runs; those behind it have fresh seeds."""
SUSPICIOUS = (0.97, 0.5, 0.01, 0.01)
"""Below this p the next stage decides."""
BEYOND_DOUBT = 1e-10
"""p of a stage of fresh seeds that spares the last for path tracers, which have no radius to shrink."""
FORGIVEN = 4.0
"""Share of a block that photon methods may be off, over the radius relative to the scene: 1 % in the last stage."""
LEAST_SEEN = 0.05
"""Least share of pixels that are enough for a comparison."""
LEAST_OF_PATHS = 0.98
"""Share of what Mitsuba's paths bring that its particles have to bring, to be believed."""
LEAST_LIGHT = 1e-5
"""Mean radiance below which nothing is compared: lights have from 0.2 to 20, and what comes of a light that shines into
its own closed shape goes by rays that slip through its edges."""
FEW_WALKS = 20
"""If so many walks are expected to count, none does with a probability of 2e-9."""
HARMLESS = ("axis of <rotate> is not of unit length", "lean from their faces")
"""The warnings that are wanted: both programs stretch by such an axis, and what leaning normals do is known."""
TERMS = {"emission": ("emission",), "direct": ("direct",), "specular": ("specular",),
         "caustic + indirect": ("caustic", "indirect")}  # fmt: skip
OF_FIRST_SURFACE = ("emission", "direct", "caustic + indirect")
SAFE_TERMS = ("emission", "direct")
"""Those that hold no caustics."""


class Runs:
    """Independent pictures of a scene by whoever is asked, rendered once a stage. `salt` gives other seeds."""

    def __init__(
        self,
        scene: Node,
        folder: Path,
        mitsuba: Mitsuba,
        pool: WorkPool,
        salt: tuple[int, ...],
        shared_kernels: bool = False,
    ) -> None:
        """With `shared_kernels` those for all kinds of surfaces run, which need not be compiled for each scene. Raises
        PmviewerError when our loader refuses the scene."""
        self.scene, self.mitsuba, self.pool, self.salt = scene, mitsuba, pool, salt
        self.path, self.flat_path = write_scene(scene, folder, "scene")
        self.opened: OpenScene = open_scene(self.path)
        if shared_kernels:
            flat = flatten(self.opened.scene, features_at_least=SURFACES)
            self.opened = replace(self.opened, flat=flat)
        self._ours: dict[tuple[str, int, int], NDArray[np.float32]] = {}
        self._weights: dict[tuple[str, int], NDArray[np.float64]] = {}
        self._theirs: dict[tuple[str, int, int], NDArray[np.float64]] = {}

    def _seeds(self, who: str, stage: int, runs: int) -> list[int]:
        entropy = [*self.salt, stage, *who.encode()]
        return [int(s) >> 1 for s in np.random.SeedSequence(entropy).generate_state(runs)]

    def ours(self, method: str, stage: int, max_depth: int = 0) -> NDArray[np.float32]:
        """(runs, h, w, 15 or, with media, 21) terms; `max_depth` 0 for whole paths."""
        key = (method, stage, max_depth)
        if key not in self._ours:
            effort = STAGES[stage]
            seeds = self._seeds(f"{method} {max_depth}", stage, effort.runs)
            more = {"max_depth": max_depth} if max_depth else {}
            found = our_runs(self.opened, method, effort, seeds, self.pool, **more)
            before = [self.ours(method, stage - 1, max_depth)] if effort.adds else []
            self._ours[key] = np.concatenate([*before, found.terms])
            if found.weights is not None:
                of_before = [self._weights[method, stage - 1]] if effort.adds else []
                self._weights[method, stage] = np.concatenate([*of_before, found.weights])
        return self._ours[key]

    def weights(self, method: str, stage: int) -> NDArray[np.float64]:
        """(runs, h, w, 4) of a weighted method: ΣG and ΣC, as `pmviewer.bench.agree.ours.Rendered` has them; nothing
        but zeros where no surface holds virtual lights."""
        terms = self.ours(method, stage)
        return self._weights.get((method, stage), np.zeros((*terms.shape[:3], 4)))

    def theirs(self, mode: str, stage: int, max_depth: int = 0) -> NDArray[np.float64]:
        """(runs, h, w, 3)"""
        mode = "volpath" if mode == "path" and has_media(self.scene) else mode
        key = (mode, stage, max_depth)
        if key not in self._theirs:
            effort = STAGES[stage]
            seeds = self._seeds(f"Mitsuba {mode} {max_depth}", stage, effort.runs)
            more = {"max_depth": max_depth} if max_depth else {}
            found = self.mitsuba.images(self.flat_path, mode, seeds, effort.spp, **more)
            before = [self.theirs(mode, stage - 1, max_depth)] if effort.adds else []
            self._theirs[key] = np.concatenate([*before, found])
        return self._theirs[key]

    @cached_property
    def seen_plainly(self) -> NDArray[np.bool_]:
        """(h, w): as `Mitsuba.seen_plainly`, asked once."""
        return self.mitsuba.seen_plainly(self.flat_path)


Pair = Callable[[int], tuple[NDArray[np.float64], NDArray[np.float64]]]
"""Summaries of both sides at a stage."""


Explain = Callable[[Comparison], str]
"""The known deviation that a disagreement comes from; empty if it is none of them."""


@dataclass(frozen=True)
class Question:
    """What may agree or not: `method` against `peer` in `what`."""

    method: str
    peer: str
    what: str
    pair: Pair
    floor: Callable[[int], NDArray[np.float64] | None] = lambda stage: None
    """What the difference of each test may be at a stage, see `negligible`."""

    def answer(self, stage: int) -> Outcome:
        """The outcome of one stage."""
        if self.method == "path":
            return compared(*self.pair(stage))
        forgiven, floor = FORGIVEN * STAGES[stage].radius, self.floor(stage)
        tails = SPIKES if self.method in VIRTUAL else TAIL, TAIL
        ours, theirs = self.pair(stage)
        found = compared(ours, theirs, forgiven, sparse=True, floor=floor, tails=tails)
        if stage < len(STAGES) - 1 or found.p >= SUSPICIOUS[-1]:
            return found
        ours_before, theirs_before = self.pair(stage - 1)
        if self.peer in PHOTON_METHODS:
            theirs = _limit(theirs, theirs_before)
        limit = compared(_limit(ours, ours_before), theirs, forgiven, sparse=True, floor=floor, tails=tails)
        return max(found, limit, key=lambda o: o.p)

    def asked(self, stages: int, explain: Explain = lambda comparison: "") -> Comparison:
        """Stage after stage while the answer is suspicious, at most `stages` of them. What fresh seeds confirm and
        `explain` knows needs no more."""
        for stage in range(stages):
            outcome = self.answer(stage)
            final = stage == len(STAGES) - 1 or (self.method == "path" and stage > FIRST and outcome.p < BEYOND_DOUBT)
            if final or outcome.p >= SUSPICIOUS[stage]:
                break
            found = Comparison(self.method, self.peer, self.what, outcome, stage + 1, final=True)
            if stage > FIRST and (known := explain(found)):
                return replace(found, known=known)
        return Comparison(self.method, self.peer, self.what, outcome, stage + 1, final)


def _limit(runs: NDArray[np.float64], before: NDArray[np.float64]) -> NDArray[np.float64]:
    """Runs (n, k) less the part of their error that goes with the radius; `before`, (m, k), have twice the radius."""
    n = min(len(runs), len(before))
    return 2 * runs[:n] - before[:n]


def unseen_in(ours: NDArray[np.float64]) -> NDArray[np.float64]:
    """Differences of a term that are none: `negligible` ones, and all in a picture that is as good as black here, where
    the light at the edges of a lamp that shines inwards is all there is. It is compared with Mitsuba's as a whole."""
    black = ours[:, :CHANNELS].mean() < LEAST_LIGHT
    return np.full(ours.shape[1], np.inf) if black else negligible(ours)


def _with_sum(weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """(runs, h, w, 3) of (runs, h, w, 2): both, and their sum, in place of channels."""
    return np.concatenate([weights, weights.sum(axis=-1, keepdims=True)], axis=-1)


def unmet_by(weights: NDArray[np.float64], passes: int) -> NDArray[np.float64]:
    """The difference of sums of weights (runs, h, w, 4) that is none, in the picture and in each block: what FEW_WALKS
    of all walks would count, of which none may have met anything yet."""
    blocks = summaries(weights).shape[1] // weights.shape[3] - 1
    walks = Settings().virtual.walks * passes * math.prod(weights.shape[:3])
    return FEW_WALKS / walks * np.concatenate([np.ones(CHANNELS), np.full(CHANNELS * blocks, float(blocks))])


def particles_hold(runs: Runs) -> bool:
    """Whether Mitsuba's particles bring at least what its own paths bring, which lack caustics: in some scenes with
    glass or mapped normals they lose light, and say nothing then."""
    plain = runs.seen_plainly
    particles, paths = (runs.theirs(mode, 0).mean(axis=0)[plain].mean() for mode in ("ptracer", "path"))
    return bool(particles >= LEAST_OF_PATHS * paths)


def questions(runs: Runs, believed: bool = False) -> Iterator[Question]:
    """All that is compared for a scene. `believed`: with Mitsuba's particles without asking whether they hold."""

    def whole(method: str, stage: int, seen: NDArray[np.bool_] | None = None) -> NDArray[np.float64]:
        return summaries(picture(runs.ours(method, stage)), seen)

    def part(method: str, name: str, stage: int) -> NDArray[np.float64]:
        return summaries(term(runs.ours(method, stage), *TERMS[name]))

    def paths(stage: int) -> NDArray[np.float64]:
        return summaries(runs.theirs("path", stage))

    def one_scattering(stage: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return summaries(picture(runs.ours("path", stage, 1))), summaries(runs.theirs("path", stage, 2))

    glows = emits(runs.scene)
    particles, alone = needs_particles(runs.scene), disperses(runs.scene) or glows
    if not alone:
        yield Question("path", "Mitsuba path", "picture", lambda s: (whole("path", s), paths(s)))
        if asks_one_scattering(runs.scene):
            yield Question("path", "Mitsuba path", "one scattering", one_scattering)
    for method in asked_methods(runs.scene):

        def by_particles(stage: int, method: str = method) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            seen = runs.seen_plainly
            return whole(method, stage, seen), summaries(runs.theirs("ptracer", stage), seen)

        def by_paths(stage: int, method: str = method) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            return whole(method, stage), paths(stage)

        def by_other(stage: int, method: str = method) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            return whole(method, stage), whole("progressive", stage)

        def by_our_paths(stage: int, method: str = method) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            return whole(method, stage), whole("path", stage)

        if glows:
            yield Question(method, "our path", "picture", by_our_paths)
        elif alone:
            pass
        elif not particles:
            yield Question(method, "Mitsuba path", "picture", by_paths)
        elif (
            not has_distant_lights(runs.scene)
            and runs.seen_plainly.mean() >= LEAST_SEEN
            and (believed or particles_hold(runs))
        ):
            yield Question(method, "Mitsuba particles", "plain pixels", by_particles)
        elif method != "progressive":
            yield Question(method, "progressive", "picture", by_other)
        if method in THIN_GLASS:
            continue
        if method in WEIGHTED:

            def by_walks(stage: int, method: str = method) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
                G, C = np.split(runs.weights(method, stage), 2, axis=-1)
                return summaries(_with_sum(G)), summaries(_with_sum(C))

            def unmet(stage: int, method: str = method) -> NDArray[np.float64]:
                return unmet_by(runs.weights(method, stage), STAGES[stage].passes)

            yield Question(method, WALKS, "weights", by_walks, unmet)
        for name in SAFE_TERMS if particles else OF_FIRST_SURFACE if alone and not glows else TERMS:

            def by_term(
                stage: int, method: str = method, name: str = name
            ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
                return part(method, name, stage), part("path", name, stage)

            yield Question(method, "our path", name, by_term, lambda s: unseen_in(whole("path", 0)))


def tried(
    scene: Node,
    folder: Path,
    mitsuba: Mitsuba,
    pool: WorkPool,
    salt: tuple[int, ...],
    stages: int = len(STAGES),
    shared_kernels: bool = False,
    explain: Explain = lambda comparison: "",
) -> Verdict:
    """Ask all questions about a scene; its files go into `folder`. `shared_kernels` as for `Runs`, `explain` as for
    `Question.asked`."""
    try:
        runs = Runs(scene, folder, mitsuba, pool, salt, shared_kernels)
        for warning in runs.opened.scene.warnings:
            if not any(harmless in warning for harmless in HARMLESS):
                return Verdict(refused=f"pmviewer warns: {warning}")
        alone = disperses(scene) or emits(scene)
        shown = (picture(runs.ours("path", 0)) if alone else runs.theirs("path", 0)).mean(axis=0)
        if shown.mean() < LEAST_LIGHT:
            return Verdict()
        comparisons = [question.asked(stages, explain) for question in questions(runs)]
    except MitsubaError as error:
        return Verdict(refused=str(error))
    except PmviewerError as error:
        return Verdict(refused=f"pmviewer: {error}")
    return Verdict(comparisons, lit=float((shown.sum(axis=-1) > 0).mean()))


def methods_of(verdict: Verdict) -> set[str]:
    """The methods that were compared with anything; all of them, or something is wrong here."""
    return {c.method for c in verdict.comparisons} | {c.peer for c in verdict.comparisons if c.peer in METHODS}
