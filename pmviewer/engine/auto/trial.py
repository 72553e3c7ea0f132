"""The measured trial: what a pass of each candidate costs, how much passes differ by chance, and by how much they are
wrong.

A pass of a small picture is rendered with two seeds and two numbers of photons. Half the squared difference of two
seeds is the variance of a pass. What of it falls with N is the photons' part, what doesn't the camera pass's; the times
of the stages fall apart in the same way. The radius is that of the whole picture, so that a pixel has the variance that
it will have there. How wrong the mean is shows against look-ups of twice the radius, or for methods that interpolate
against the plain final gather: the product of the differences of two independent pairs of passes has the squared
difference of their biases as its mean, without the noise of either.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.auto.bias import ORDER
from pmviewer.engine.auto.candidates import CACHE, GATHER, Candidate, assignments
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.radius import first_radius
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.output.metric import EPSILON
from pmviewer.render.camera import resolve_camera
from pmviewer.render.planes import beauty_of
from pmviewer.settings.access import Settings, with_values

Tell = Callable[[str, float | None], None]
F8 = NDArray[np.float64]

FEWER = 4
"""Photons of the larger trial pass over those of the smaller one."""
OUTLIERS = 0.0005
"""Share of the noisiest pixels that say nothing in two passes."""
RARE = 2.0
"""What the photons' variance of a few small pictures is multiplied by: photons that are rare and bright are missing in
nearly all of them, and make half of the error of a long picture (measured on cornell_glossy, office, museum)."""
BLOCK = 4
"""What interpolation does is compared in blocks of so many pixels squared: its bias is smooth, noise is not. Pictures
with two radii have the same photons and camera rays, and little noise in their difference."""
SEEDS = (7_919, 104_729)
"""Added to the picture's seed."""
STORE = 1 << 28
WIDER = 2.0
"""Radius that bias is told from, relative to that of the first pass."""


@dataclass(frozen=True)
class Costs:
    """CPU seconds of a pass of the whole picture: `base`, and `light` and `look_up` per trajectory. The latter goes
    with the area of look-ups."""

    base: float
    light: float
    look_up: float

    def of(self, N: int, area: float) -> float:
        """Of a pass of N trajectories, with look-ups of that area relative to the trial's."""
        return self.base + N * (self.light + area * self.look_up)


@dataclass(frozen=True)
class Measured:
    """`eye` is the relative variance of a pass that photons don't decide, `photons` that of one trajectory's; `bias2`
    the squared relative bias of the first pass. `radius`: of the first pass, relative to the scene."""

    candidate: Candidate
    costs: Costs
    eye: float
    photons: float
    bias2: float
    radius: float
    interpolated: bool = False
    """Whether the bias is that of interpolation."""
    blurs: bool = False
    """Whether pixels look photons up within a radius that shrinks: the global map, or caustics beside a gather."""


@dataclass
class Trial:
    """What was measured, by candidate; `cpu_seconds` and `seconds` that it took, without compiling."""

    measured: list[Measured] = field(default_factory=list)
    cpu_seconds: float = 0.0
    seconds: float = 0.0
    pixels: int = 0


@dataclass
class _Run:
    """Pictures of the two seeds with one N, and the CPU seconds by stage of the quicker one."""

    N: int
    images: list[F8]
    stages: dict[str, float]


def trial(
    opened: OpenScene,
    settings: Settings,
    candidates: list[Candidate],
    pool: WorkPool,
    size: tuple[int, int],
    tell: Tell,
) -> Trial:
    """Measure the candidates on a picture of that size. Raises Cancelled when the pool is cancelled."""
    N = settings.photons.N
    result = Trial(pixels=size[0] * size[1])
    full = resolve_camera(opened.scene, settings.camera)
    runs: dict[str, tuple[Candidate, list[_Run], float]] = {}
    wide: dict[str, _Run] = {}
    store, light = StageStore(STORE), dict[int, float]()
    for candidate in candidates:
        chosen = with_values(settings, assignments(candidate.values))
        prepare(opened, chosen, pool, tell)
    started, before = time.perf_counter(), pool.cpu_seconds
    for number, candidate in enumerate(candidates):
        tell(f"trying {candidate.name}", number / len(candidates))
        chosen = with_values(settings, assignments(candidate.values))
        plan = plan_of(chosen, opened.traits)
        radius = first_radius(opened.flat, full, chosen.estimate, plan.gather) / opened.flat.radius
        shrink = size[0] / full.width
        small = {
            "camera.width": size[0],
            "camera.height": size[1],
            "estimate.radius": min(max(radius, 1e-7), 10.0),
            "gather.cache_min": max(chosen.gather.cache_min * shrink, 0.1),
            "gather.cache_max": max(chosen.gather.cache_max * shrink, 1.0),
        }
        counts = (N, N // FEWER) if plan.photons else (N,)
        found = [_run(opened, with_values(chosen, small), count, pool, store, light) for count in counts]
        runs[candidate.name] = candidate, found, radius
        if plan.shown_directly | plan.caustic_mask:
            small["estimate.radius"] = min(WIDER * radius, 10.0)
            wide[candidate.name] = _run(opened, with_values(chosen, small), N, pool, store, light)
    mean = np.mean([image for _, found, _ in runs.values() for run in found for image in run.images], axis=0)
    scale = full.width * full.height / result.pixels
    gathers = runs.get(GATHER.name)
    for name, (candidate, found, radius) in runs.items():
        bias2 = 0.0
        if name in wide:
            bias2 = _bias2(wide[name].images, found[0].images, mean, 1) / (WIDER**ORDER - 1) ** 2
        interpolated = 0.0
        if candidate is CACHE and gathers is not None:
            interpolated = _bias2(found[0].images, gathers[1][0].images, mean, BLOCK)
        measured = _measured(candidate, found, radius, mean, scale, max(bias2, interpolated))
        result.measured.append(replace(measured, interpolated=interpolated > bias2, blurs=name in wide))
    result.seconds, result.cpu_seconds = time.perf_counter() - started, pool.cpu_seconds - before
    return result


def _run(
    opened: OpenScene, settings: Settings, N: int, pool: WorkPool, store: StageStore, light: dict[int, float]
) -> _Run:
    """A pass with each seed. `light` remembers what light passes cost whose photons the store has by now."""
    images: list[F8] = []
    stages: dict[str, float] = {}
    guided = settings.importance.emission != "off"
    for seed in SEEDS:
        chosen = with_values(settings, {"photons.N": N, "render.seed": (settings.render.seed + seed) % 2**31})
        renderer = Renderer(opened, chosen, pool, store)
        renderer.step()
        images.append(beauty_of(renderer.film.planes()).astype(np.float64))
        for name, spent in renderer.tally.stage_seconds.items():
            stages[name] = min(stages.get(name, math.inf), spent)
    if "light pass" in stages and not guided:
        light[N] = stages["light pass"] = max(stages["light pass"], light.get(N, 0.0))
    return _Run(N, images, stages)


def _measured(candidate: Candidate, runs: list[_Run], radius: float, mean: F8, scale: float, bias2: float) -> Measured:
    variances = [_variance(run.images, mean) for run in runs]
    eye, photons = variances[0], 0.0
    if len(runs) > 1:
        many, few = runs
        photons = max(variances[1] - variances[0], 0.0) / (1 / few.N - 1 / many.N)
        photons = min(photons, variances[0] * many.N)
        eye = variances[0] - photons / many.N
        photons *= RARE
    return Measured(candidate, _costs(runs, scale), eye, photons, bias2, radius)


def _relative(squares: F8, mean: F8) -> F8:
    return (squares / (mean**2 + EPSILON)).mean(axis=-1)


def _variance(images: list[F8], mean: F8) -> float:
    """Relative variance of a pass, without the noisiest pixels."""
    each = np.sort(_relative((images[0] - images[1]) ** 2 / 2, mean), axis=None)
    return float(each[: each.size - round(each.size * OUTLIERS)].mean())


def _bias2(images: list[F8], against: list[F8], mean: F8, size: int) -> float:
    """Squared relative bias against the other pictures, in blocks; 0 where it does not stand out of the noise."""
    first, second = (_blocks(a - b, size) for a, b in zip(images, against, strict=True))
    products = _relative(first * second, _blocks(mean, size))
    found, error = float(products.mean()), float(products.std()) / math.sqrt(products.size)
    return found if found > 2 * error else 0.0


def _blocks(image: F8, size: int) -> F8:
    if size == 1:
        return image
    h, w = (max(side // size, 1) for side in image.shape[:2])
    cut = image[: h * size, : w * size]
    return cut.reshape(h, cut.shape[0] // h, w, cut.shape[1] // w, 3).mean(axis=(1, 3))


def _costs(runs: list[_Run], scale: float) -> Costs:
    """The times of stages as base and slope over N; what is done per pixel counts `scale` times."""
    many = runs[0]
    if len(runs) == 1:
        return Costs(scale * sum(many.stages.values()), 0.0, 0.0)
    few = runs[1]
    base = light = look_up = 0.0
    for name, spent in many.stages.items():
        slope = min(max(spent - few.stages.get(name, 0.0), 0.0) / (many.N - few.N), spent / many.N)
        fixed = spent - slope * many.N
        if name == "camera pass":
            base, look_up = base + scale * fixed, look_up + scale * slope
        else:
            base, light = base + fixed, light + slope
    return Costs(base, light, look_up)
