"""The measured trial: what a pass of each candidate costs, how much passes differ by chance, and by how much they are
wrong.

A pass is rendered with two numbers of photons and two seeds, or more as the time allows, of pixels that are spread over
the picture, each as large as it will be: larger ones would average the bias of what is narrower than they are away. The
variance over the seeds is that of a pass. What of it falls with N is the photons' part, what doesn't the camera pass's;
the times of the stages fall apart in the same way. What either radius does, that of caustics and that of the global map
where it is shown, is told by passes with twice and half of it (`pmviewer.engine.auto.widths`).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from pmviewer.engine.auto.bias import Bias
from pmviewer.engine.auto.candidates import GATHER, Candidate, assignments
from pmviewer.engine.auto.measured import BY_PHOTONS, BY_POWER, Costs, Measured, Widths
from pmviewer.engine.auto.relative import F8, squared, variance
from pmviewer.engine.auto.widths import HIDDEN, NONE, WIDER, Tried, Widened, told_by
from pmviewer.engine.method import Plan, plan_of
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.radius import first_radius
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.stages.projection import projection_for
from pmviewer.engine.store import StageStore
from pmviewer.render.camera import resolve_camera
from pmviewer.render.filter import filter_of, noise_share
from pmviewer.render.planes import PLANES, beauty_of
from pmviewer.settings.access import Settings, with_values

Tell = Callable[[str, float | None], None]

FEWER = 4
"""Photons of the larger trial pass over those of the smaller one."""
RARE = 2.0
"""What the variance that gather rays bring from photons is multiplied by: bright ones that few rays find are missing
in nearly all of a few small pictures (the whole pictures had 1.0 to 4.5 times as much: cornell_diffuse, rooms_10x10,
museum, office). Maps that are shown have none: different radii tell their part to a tenth, in office to a quarter."""
MORE = 4
"""Light samples of the passes that tell what these do, over the usual number."""
MOST_DIRECT = 0.9
"""Most of the camera rays' part that light samples are taken to make: edges and surfaces are some of it."""
BLOCK = 4
"""What interpolation does is compared in blocks of so many pixels squared: its bias is smooth, noise is not. Pictures
with two radii have the same photons and camera rays, and little noise in their difference."""
SEEDS = ((7_919, 104_729), (1_299_709, 15_485_863), (32_452_843, 49_979_687))
"""Added to the picture's seed; the second pair where a trial that is twice as long still fits, and so on."""
SAMPLED = ("direct", "specular")
"""Terms of the picture that light samples are seen in."""
LOOKED_UP = ("specular", "caustic", "indirect", "volume", "volume indirect")
"""Terms that photons are seen in. The noise of direct light would hide them."""
STORE = 1 << 28


@dataclass
class Trial:
    """What was measured, by candidate, with so many seeds; `cpu_seconds` and `seconds` that it took, without
    compiling."""

    measured: list[Measured] = field(default_factory=list)
    cpu_seconds: float = 0.0
    seconds: float = 0.0
    pixels: int = 0
    seeds: int = 0


@dataclass
class _Run:
    """Pictures of the seeds with such settings, of them what light samples make, directly or over what is followed,
    and what photons do; and the CPU seconds by stage of the quickest one."""

    settings: Settings
    images: list[F8] = field(default_factory=list)
    sampled: list[F8] = field(default_factory=list)
    looked_up: list[F8] = field(default_factory=list)
    stages: dict[str, float] = field(default_factory=dict)

    @property
    def N(self) -> int:
        return self.settings.photons.N


@dataclass
class _Tried:
    """A candidate's runs: with all photons and with fewer, with other radii, and with more light samples."""

    candidate: Candidate
    plan: Plan
    radius: float
    runs: list[_Run]
    caustic: list[_Run] = field(default_factory=list)
    shown: list[_Run] = field(default_factory=list)
    direct: list[_Run] = field(default_factory=list)


class _Trier:
    """Renders what is tried. Settings have the N of the larger passes."""

    def __init__(self, opened: OpenScene, settings: Settings, pool: WorkPool, size: tuple[int, int]) -> None:
        self._opened, self._settings, self._pool = opened, settings, pool
        self._full = resolve_camera(opened.scene, settings.camera)
        self._size, self._side = size, size[0] / self._full.width
        self.kept = noise_share(filter_of(self._full.filter, settings.render))
        """Share of the variance of a pixel's samples that is left where pixels share them, which those of a trial are
        too far apart for."""
        self.scale = self._full.width * self._full.height / (size[0] * size[1])
        self._store = StageStore(STORE)
        self._light: dict[int, float] = {}  # what light passes cost whose photons the store has by now

    def settings_of(self, candidate: Candidate) -> Settings:
        return with_values(self._settings, assignments(candidate.values))

    def planned(self, candidate: Candidate) -> _Tried:
        """All its runs, with no pictures yet."""
        chosen = self.settings_of(candidate)
        plan = plan_of(chosen, self._opened.traits)
        radius = first_radius(self._opened.flat, self._full, chosen.estimate, plan.gather) / self._opened.flat.radius
        radius = min(max(radius, 1e-7), 10.0)
        small = with_values(
            chosen,
            {
                "camera.width": self._size[0],
                "camera.height": self._size[1],
                "estimate.radius": radius,
                "gather.cache_min": max(chosen.gather.cache_min * self._side, 0.1),
                "gather.cache_max": max(chosen.gather.cache_max * self._side, 1.0),
            },
        )
        N = chosen.photons.N
        counts = (N, N // FEWER) if plan.photons else (N,)
        found = _Tried(candidate, plan, radius, [_Run(with_values(small, {"photons.N": count})) for count in counts])
        if plan.shown_directly:
            found.shown = [_Run(with_values(small, w.values(chosen, radius))) for w in _either("shown")]
        if plan.direct and not plan.gather:  # beside a gather they are the same
            fewest = found.runs[-1].settings
            found.direct = [_Run(with_values(fewest, {"direct.samples": MORE * plan.light_samples}))]
        if plan.caustic_mask and not plan.gather:  # beside a gather they are the same
            found.caustic = [_Run(with_values(small, w.values(chosen, radius))) for w in _either("caustic")]
        return found

    def render(self, tried: _Tried, seeds: tuple[int, int]) -> None:
        """A pass with each seed of each of its runs."""
        for run in (*tried.runs, *tried.shown, *tried.caustic, *tried.direct):
            for seed in seeds:
                self._pass(run, seed)
            if "light pass" in run.stages and run.settings.importance.emission == "off":
                light = max(run.stages["light pass"], self._light.get(run.N, 0.0))
                self._light[run.N] = run.stages["light pass"] = light

    def _pass(self, run: _Run, seed: int) -> None:
        chosen = with_values(run.settings, {"render.seed": (run.settings.render.seed + seed) % 2**31})
        renderer = Renderer(self._opened, chosen, self._pool, self._store)
        renderer.camera = replace(renderer.camera, pixel_side=min(self._side, 1.0))
        renderer.step()
        planes = renderer.film.planes()
        run.images.append(beauty_of(planes).astype(np.float64))
        for terms, images in ((SAMPLED, run.sampled), (LOOKED_UP, run.looked_up)):
            there = [planes[..., PLANES[term]] for term in terms if PLANES[term].stop <= planes.shape[-1]]
            images.append(np.sum(there, axis=0, dtype=np.float64))
        for name, seconds in renderer.tally.stage_seconds.items():
            run.stages[name] = min(run.stages.get(name, math.inf), seconds)


def trial(
    opened: OpenScene,
    settings: Settings,
    candidates: list[Candidate],
    pool: WorkPool,
    size: tuple[int, int],
    seconds: float,
    tell: Tell,
) -> Trial:
    """Measure the candidates on that many columns and rows of pixels, with as many pairs of seeds as fit into those CPU
    seconds, one at least. Raises Cancelled when the pool is cancelled."""
    result, trier = Trial(pixels=size[0] * size[1]), _Trier(opened, settings, pool, size)
    for candidate in candidates:
        prepare(opened, trier.settings_of(candidate), pool, tell)
    started, before = time.perf_counter(), pool.cpu_seconds
    every = [trier.planned(candidate) for candidate in candidates]
    for done, seeds in enumerate(SEEDS):
        if done and (pool.cpu_seconds - before) * (done + 1) / done > seconds:
            break
        for number, tried in enumerate(every):
            tell(f"trying {tried.candidate.name}", number / len(every))
            trier.render(tried, seeds)
    covered = _covered(opened, trier.settings_of(every[0].candidate))
    mean = np.mean([image for tried in every for run in tried.runs for image in run.images], axis=0)
    gathers = next((tried for tried in every if tried.candidate.is_like(GATHER)), None)
    with_samples = next((tried for tried in every if tried.direct), None)
    with_caustics = next((tried for tried in every if tried.caustic), None)
    for tried in every:
        interpolated = 0.0
        if tried.plan.cache and gathers is not None:
            interpolated = squared(tried.runs[0].images, gathers.runs[0].images, mean, BLOCK)
        source = tried if tried.caustic or not tried.plan.caustic_mask else with_caustics
        caustic = _widened(source, "caustic", mean, trier.scale, 0.0) if source is not None else NONE
        if source is not None:
            caustic = caustic.wider(tried.radius / source.radius)
        shown = _widened(tried, "shown", mean, trier.scale, HIDDEN)
        bias = Bias(caustic.blur, shown.blur, interpolated)
        measured = _measured(tried, (caustic, shown), bias, mean, trier.scale)
        if tried.plan.direct and with_samples is not None:
            measured = _sampled(measured, with_samples, mean, trier.scale)
        measured = measured.shared(trier.kept)
        result.measured.append(replace(measured, covered=covered if _aims(tried) else 0.0))
    result.seeds = len(every[0].runs[0].images)
    result.seconds, result.cpu_seconds = time.perf_counter() - started, pool.cpu_seconds - before
    return result


def _aims(tried: _Tried) -> bool:
    """Whether photons may start for the caustic map alone: guided ones fill both maps, and where it holds light from
    diffuse surfaces, too, fewer of the others make that worse."""
    photons = tried.runs[0].settings.photons
    return bool(tried.plan.caustic_mask) and tried.plan.emission == "off" and not photons.indirect_caustics


def _covered(opened: OpenScene, settings: Settings) -> float:
    """Share of the light that photons for the caustic map alone would start in."""
    made = projection_for(opened, with_values(settings, {"photons.q": 0.5}))
    return min(made.caustic_power / made.surface_power, 1.0) if made is not None else 1.0


def _either(name: str) -> list[Widths]:
    return [Widths(**{name: WIDER}), Widths(**{name: 1 / WIDER})]


def _widened(tried: _Tried, name: str, mean: F8, scale: float, hidden: float) -> Widened:
    """What passes with other radii of that name tell; nothing without them. hidden: as for `told_by`."""
    runs: list[_Run] = getattr(tried, name)
    if not runs:
        return NONE
    wide, narrow = (Tried(run.images, run.stages.get("camera pass", 0.0)) for run in runs)
    usual = Tried(tried.runs[0].images, 0.0)
    found = told_by(wide, usual, narrow, mean, hidden)
    N = tried.runs[0].N
    return replace(found, variance=found.variance * N, cost=found.cost * scale / N)


def _measured(tried: _Tried, widened: tuple[Widened, Widened], bias: Bias, mean: F8, scale: float) -> Measured:
    variances = [variance(run.images, mean) for run in tried.runs]
    caustic, shown = (part.variance for part in widened)
    eye, gathered = variances[0], 0.0
    if len(tried.runs) > 1:
        many, few = tried.runs
        seen = [variance(run.looked_up, mean) for run in tried.runs]
        photons = max(seen[1] - seen[0], 0.0) / (1 / few.N - 1 / many.N)
        photons = min(max(photons, caustic + shown), variances[0] * many.N)
        eye = variances[0] - photons / many.N
        fitting = min(1.0, photons / (caustic + shown)) if caustic + shown > 0 else 1.0
        caustic, shown = caustic * fitting, shown * fitting
        gathered = max(photons - caustic - shown, 0.0)
    costs = _costs(tried.runs, (widened[0].cost, widened[1].cost), scale)
    return Measured(tried.candidate, costs, eye, caustic, shown, RARE * gathered, bias, tried.radius)


def _sampled(measured: Measured, source: _Tried, mean: F8, scale: float) -> Measured:
    """With what light samples do, told by passes with `MORE` times as many and the same photons and camera rays, by the
    terms that they make: the noise of others would hide it. Their variance is taken to fall as chance's does; it falls
    faster (`pmviewer.render.direct.samples`)."""
    usual, many = source.runs[-1], source.direct[0]
    direct = max(variance(usual.sampled, mean) - variance(many.sampled, mean), 0.0) / (1 - 1 / MORE)
    spent = max(many.stages["camera pass"] - usual.stages["camera pass"], 0.0) * scale / (MORE - 1)
    complement = BY_PHOTONS if source.plan.asks_photons else BY_POWER
    costs = replace(measured.costs, sampled=spent)
    return replace(measured, direct=min(direct, MOST_DIRECT * measured.eye), complement=complement, costs=costs)


def _costs(runs: list[_Run], look_ups: tuple[float, float], scale: float) -> Costs:
    """The times of stages as base and slope over N; what is done per pixel counts `scale` times. `look_ups`: what those
    of either map cost, as far as they are in the slope."""
    many = runs[0]
    if len(runs) == 1:
        return Costs(scale * sum(many.stages.values()), 0.0)
    few = runs[1]
    base = light = stored = in_camera = 0.0
    for name, spent in many.stages.items():
        slope = min(max(spent - few.stages.get(name, 0.0), 0.0) / (many.N - few.N), spent / many.N)
        fixed = spent - slope * many.N
        if name == "camera pass":
            base, in_camera = base + scale * fixed, in_camera + scale * slope
        elif name == "light pass":
            base, light = base + fixed, light + slope
        else:
            base, stored = base + fixed, stored + slope
    fitting = min(1.0, in_camera / sum(look_ups)) if sum(look_ups) > 0 else 0.0
    caustic, shown = (fitting * cost for cost in look_ups)
    return Costs(base, light, caustic, shown, stored + in_camera - caustic - shown)
