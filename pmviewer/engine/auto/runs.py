"""The pictures of a trial: what is rendered of each candidate, and with which settings."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace

import numpy as np

from pmviewer.engine.auto.candidates import GATHER, Candidate
from pmviewer.engine.auto.measured import Trial, Widths
from pmviewer.engine.auto.relative import F8
from pmviewer.engine.auto.size import FEWEST_PHOTONS, OF_DEAREST, PROBED, Size, fitted
from pmviewer.engine.auto.sparse import wider_by, with_wider
from pmviewer.engine.auto.widths import WIDER
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.plan import Plan
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.radius import FirstRadii
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.stages.spread import radii_of_first_pass
from pmviewer.engine.store import StageStore
from pmviewer.render.camera import resolve_camera
from pmviewer.render.filter import filter_of, noise_share
from pmviewer.render.planes import PLANES, beauty_of
from pmviewer.settings.access import Settings, with_values
from pmviewer.settings.presets import assignments

FEWER = 4
"""Photons of the larger trial pass over those of the smaller one."""
MORE = 4
"""Light samples of the passes that tell what these do, over the usual number."""
SEEDS = ((7_919, 104_729), (1_299_709, 15_485_863), (32_452_843, 49_979_687))
"""Added to the picture's seed; the second pair where a trial that is twice as long still fits, and so on."""
SAMPLED = ("direct", "specular")
"""Terms of the picture that light samples are seen in."""
LOOKED_UP = ("specular", "caustic", "indirect", "volume", "volume indirect")
"""Terms that photons are seen in. The noise of direct light would hide them."""
STORE = 1 << 28
JUDGED = 3
"""Pictures after which it is known whether a trial takes too long."""


class TooDearError(Exception):
    """A trial would take `expected` CPU seconds, more than it may; `begun` is what it has taken."""

    def __init__(self, expected: float, begun: Trial) -> None:
        super().__init__(expected)
        self.expected, self.begun = expected, begun


@dataclass
class Run:
    """Pictures of the seeds with such settings, of them what light samples make, directly or over what is followed,
    and what photons do; and the CPU seconds by stage of the quickest one."""

    settings: Settings
    images: list[F8] = field(default_factory=list)
    sampled: list[F8] = field(default_factory=list)
    looked_up: list[F8] = field(default_factory=list)
    stages: dict[str, float] = field(default_factory=dict)

    @property
    def N(self) -> int:
        """Its trajectories."""
        return self.settings.photons.N


@dataclass
class Attempt:
    """A candidate's runs: with all photons and with fewer, with other radii, and with more light samples. `gathered`:
    with a wider one where gather rays end. `first`: radii of the first pass, relative to the scene."""

    candidate: Candidate
    plan: Plan
    first: FirstRadii
    runs: list[Run]
    caustic: list[Run] = field(default_factory=list)
    shown: list[Run] = field(default_factory=list)
    direct: list[Run] = field(default_factory=list)
    gathered: list[Run] = field(default_factory=list)

    @property
    def every(self) -> list[Run]:
        """All of them."""
        return [*self.runs, *self.shown, *self.caustic, *self.direct, *self.gathered]


class Trier:
    """Renders what is tried, in `most` CPU seconds. Settings have the N of the larger passes."""

    def __init__(
        self, opened: OpenScene, settings: Settings, pool: WorkPool, size: tuple[int, int], most: float
    ) -> None:
        self._opened, self._settings, self._pool = opened, settings, pool
        self._full = resolve_camera(opened.scene, settings.camera)
        self._size = Size(*size, settings.photons.N)
        self.kept = noise_share(filter_of(self._full.filter, settings.render))
        """Share of the variance of a pixel's samples that is left where pixels share them, which those of a trial are
        too far apart for."""
        self._store = StageStore(STORE)
        self._light: dict[int, float] = {}  # what light passes cost whose photons the store has by now
        self._most, self._pictures, self._done = most, 0, 0
        self._before, self._started, self._in_camera = 0.0, 0.0, 0.0

    @property
    def pixels(self) -> int:
        """Of each picture."""
        return self._size.pixels

    @property
    def scale(self) -> float:
        """Pixels of the whole picture over these."""
        return self._full.width * self._full.height / self.pixels

    @property
    def _side(self) -> float:
        return self._size.width / self._full.width

    def fit(self, candidates: list[Candidate], seconds: float) -> None:
        """Fewer pixels and photons, if either would cost more than so many CPU seconds. A small picture tells, by a way
        that gathers, whose pixels cost most."""
        candidate = next((c for c in candidates if c.gathers), candidates[0])
        probe = self._size.smaller(PROBED, FEWEST_PHOTONS)
        values = {"camera.width": probe.width, "camera.height": probe.height, "photons.N": probe.N}
        renderer = Renderer(
            self._opened, with_values(self.planned(candidate).runs[0].settings, values), self._pool, self._store
        )
        renderer.camera = replace(renderer.camera, pixel_side=min(probe.width / self._full.width, 1.0))
        renderer.step()
        stages, seeds = renderer.tally.stage_seconds, len(SEEDS[0])
        pictures = seeds * sum(len(self.planned(c).every) for c in candidates)
        per_pixel = OF_DEAREST * stages.get("camera pass", 0.0) / probe.pixels * pictures
        per_trajectory = stages.get("light pass", 0.0) / probe.N * seeds * (1 + 1 / FEWER)
        self._size = fitted(self._size, per_pixel, per_trajectory, seconds)

    def settings_of(self, candidate: Candidate) -> Settings:
        """Of the whole picture by that candidate, with the N of the larger passes."""
        return with_values(self._settings, assignments(candidate.values) | {"photons.N": self._size.N})

    def spread(self, candidates: list[Candidate], seconds: float = 0.0) -> list[Candidate]:
        """The candidates, with wider look-ups where gather rays end if photons lie far apart for a picture of so many
        CPU seconds (`pmviewer.engine.auto.sparse`). The photons are those of the first pictures."""
        first = next((c for c in candidates if c.gathers and not c.by_nearest), None)
        if first is None:
            return candidates
        chosen = self.settings_of(first)
        pixel = {"camera.width": 1, "camera.height": 1, "render.seed": _seed(chosen, SEEDS[0][0])}
        renderer = Renderer(self._opened, with_values(chosen, pixel), self._pool, self._store)
        renderer.step()
        self._light[chosen.photons.N] = renderer.tally.stage_seconds.get("light pass", 0.0)
        photons = renderer.latest.maps.photons if renderer.latest is not None else None
        usual = self._first(chosen).global_
        places = photons.global_[:, :3] if photons is not None else np.empty((0, 3), np.float32)
        wider = wider_by(places, chosen.photons.N, usual, seconds)
        if wider == 1.0:
            return candidates
        return [self._with_wider(c, wider) if c.gathers and not c.by_nearest else c for c in candidates]

    def _with_wider(self, candidate: Candidate, wider: float) -> Candidate:
        chosen = self.settings_of(candidate)
        return with_wider(candidate, chosen, self._first(chosen).scaled(1 / self._opened.flat.radius), wider)

    def _first(self, chosen: Settings) -> FirstRadii:
        """Radii of the first pass of the whole picture by these settings."""
        plan = plan_of(chosen, self._opened.traits)
        return radii_of_first_pass(self._opened, chosen, plan, self._full, self._pool.run, self._store)

    def planned(self, candidate: Candidate) -> Attempt:
        """All its runs, with no pictures yet."""
        chosen = self.settings_of(candidate)
        plan = plan_of(chosen, self._opened.traits)
        first = self._first(chosen).scaled(1 / self._opened.flat.radius)
        small = with_values(
            chosen,
            {
                "camera.width": self._size.width,
                "camera.height": self._size.height,
                **first.values(chosen.estimate),
                "gather.cache_min": max(chosen.gather.cache_min * self._side, 0.1),
                "gather.cache_max": max(chosen.gather.cache_max * self._side, 1.0),
            },
        )
        N = chosen.photons.N
        counts = (N, N // FEWER) if plan.photons else (N,)
        runs = [Run(with_values(small, {"photons.N": count})) for count in counts]
        found = Attempt(candidate, plan, first, runs)
        there = replace(first, usual=first.global_)  # media in the small pictures go with that, as a number
        if plan.shown_directly and not candidate.by_nearest:
            found.shown = [Run(with_values(small, w.values(small, there))) for w in _either("shown")]
        if plan.direct and not plan.gather:  # beside a gather they are the same
            fewest = found.runs[-1].settings
            found.direct = [Run(with_values(fewest, {"direct.samples": MORE * plan.light_samples}))]
        if plan.caustic_mask and not plan.gather and not candidate.by_nearest:  # beside a gather they are the same
            found.caustic = [Run(with_values(small, w.values(small, there))) for w in _either("caustic")]
        if candidate.is_like(GATHER) and not candidate.by_nearest:  # the others have about the same
            found.gathered = [Run(with_values(small, Widths(shown=WIDER).values(small, there)))]
        return found

    def begin(self) -> None:
        """Before anything is rendered."""
        self._before, self._started = self._pool.cpu_seconds, time.perf_counter()

    def expect(self, every: list[Attempt]) -> None:
        """What is to be rendered."""
        self._pictures = len(SEEDS[0]) * sum(len(tried.every) for tried in every)

    @property
    def spent(self) -> Trial:
        """What it has taken since, with nothing measured."""
        cpu_seconds = self._pool.cpu_seconds - self._before
        return Trial(cpu_seconds=cpu_seconds, seconds=time.perf_counter() - self._started)

    def render(self, tried: Attempt, seeds: tuple[int, int]) -> None:
        """A pass with each seed of each of its runs. Raises TooDearError once that is known."""
        for run in tried.every:
            for seed in seeds:
                self._pass(run, seed)
                self._done += 1
                if self._done == JUDGED:  # most photons are traced by now, and serve all candidates
                    expected = self.spent.cpu_seconds + self._in_camera * (self._pictures / self._done - 1)
                    if expected > self._most:
                        raise TooDearError(expected, self.spent)
            if "light pass" in run.stages and run.settings.importance.emission == "off":
                light = max(run.stages["light pass"], self._light.get(run.N, 0.0))
                self._light[run.N] = run.stages["light pass"] = light

    def _pass(self, run: Run, seed: int) -> None:
        chosen = with_values(run.settings, {"render.seed": _seed(run.settings, seed)})
        renderer = Renderer(self._opened, chosen, self._pool, self._store)
        renderer.camera = replace(renderer.camera, pixel_side=min(self._side, 1.0))
        renderer.step()
        planes = renderer.film.planes()
        run.images.append(beauty_of(planes).astype(np.float64))
        for terms, images in ((SAMPLED, run.sampled), (LOOKED_UP, run.looked_up)):
            there = [planes[..., PLANES[term]] for term in terms if PLANES[term].stop <= planes.shape[-1]]
            images.append(np.sum(there, axis=0, dtype=np.float64))
        self._in_camera += renderer.tally.stage_seconds.get("camera pass", 0.0)
        for name, seconds in renderer.tally.stage_seconds.items():
            run.stages[name] = min(run.stages.get(name, math.inf), seconds)


def _seed(settings: Settings, added: int) -> int:
    return (settings.render.seed + added) % 2**31


def _either(name: str) -> list[Widths]:
    return [Widths(**{name: WIDER}), Widths(**{name: 1 / WIDER})]
