"""The measured trial: what a pass of each candidate costs, how much passes differ by chance, and by how much they are
wrong.

A pass is rendered with two numbers of photons and two seeds, or more as the time allows, of pixels that are spread over
the picture, each as large as it will be: larger ones would average the bias of what is narrower than they are away. The
variance over the seeds is that of a pass. What of it falls with N, which pictures of the same seed tell, is the
photons' part, what doesn't the camera pass's; the times of the stages fall apart in the same way. What either radius
does, that of caustics and that of the global map where it is shown, is told by passes with twice and half of it
(`pmviewer.engine.auto.widths`); what look-ups at the ends of gather rays lack, by passes with twice of it.
`pmviewer.engine.auto.runs` renders the pictures.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pmviewer.engine.auto.bias import GATHERED_ORDER, Bias, Blur
from pmviewer.engine.auto.candidates import FARTHER, FARTHER_NAME, GATHER, LESS_BIAS, MORE_COST, Candidate
from pmviewer.engine.auto.measured import BY_PHOTONS, BY_POWER, Costs, Measured, Trial
from pmviewer.engine.auto.relative import F8, nested, shown_squared, squared, variance
from pmviewer.engine.auto.runs import MORE, SEEDS, Attempt, Run, Trier
from pmviewer.engine.auto.widths import HIDDEN, NONE, WIDER, Tried, Widened, told_by
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.stages.projection import projection_for
from pmviewer.settings.access import Settings, with_values

Tell = Callable[[str, float | None], None]

RARE = 2.0
"""What the variance that gather rays bring from photons is multiplied by: bright ones that few rays find are missing in
nearly all of a few small pictures. With it gathers had 0.42 to 1.9 times the error that was promised of them, 1.0 times
in the median (seven scenes and files, eight CPU seconds, two seeds, less the references' noise). Maps that are shown
have none: different radii tell their part to a tenth, in office to a quarter."""
MOST_DIRECT = 0.9
"""Most of the camera rays' part that light samples are taken to make: edges and surfaces are some of it."""
BLOCK = 4
"""What interpolation does, or look-ups at the ends of gather rays, is compared in blocks of so many pixels squared:
bias is smooth there, noise is not. Pictures with two radii of shown maps have the same photons and camera rays, and
little noise in their difference."""


def trial(
    opened: OpenScene,
    settings: Settings,
    candidates: list[Candidate],
    pool: WorkPool,
    size: tuple[int, int],
    seconds: float,
    tell: Tell,
    most: float = math.inf,
    whole: float = 0.0,
) -> Trial:
    """Measure the candidates on that many columns and rows of pixels, or fewer, with as many pairs of seeds as fit into
    those CPU seconds, one at least (0: one, on all of these pixels); the picture is to take `whole`. Raises Cancelled
    when the pool is cancelled, and TooDearError where one would take more than `most`."""
    trier = Trier(opened, settings, pool, size, most)
    for candidate in candidates:
        prepare(opened, trier.settings_of(candidate), pool, tell)
    trier.begin()
    if seconds:
        trier.fit(candidates, seconds)
    every = [trier.planned(candidate) for candidate in trier.spread(candidates, whole)]
    trier.expect(every)
    for done, seeds in enumerate(SEEDS):
        if done and trier.spent.cpu_seconds * (done + 1) / done > seconds:
            break
        for number, tried in enumerate(every):
            tell(f"trying {tried.candidate.name}", number / len(every))
            trier.render(tried, seeds)
    result = replace(trier.spent, pixels=trier.pixels, seeds=len(every[0].runs[0].images))
    covered = _covered(opened, trier.settings_of(every[0].candidate))
    pictures = [np.mean(images, axis=0) for images in zip(*(run.images for t in every for run in t.runs), strict=True)]
    mean, square = np.mean(pictures, axis=0), shown_squared(pictures)
    gathers = next((tried for tried in every if tried.candidate.is_like(GATHER)), None)
    at_ends = _at_ends(gathers, mean) if gathers is not None and gathers.gathered else Blur()
    with_samples = next((tried for tried in every if tried.direct), None)
    with_caustics = next((tried for tried in every if tried.caustic), None)
    for tried in every:
        interpolated = 0.0
        if tried.plan.cache and gathers is not None:
            interpolated = squared(tried.runs[0].images, gathers.runs[0].images, mean, BLOCK)
        by_radius = tried.plan.caustic_mask and not tried.candidate.by_nearest
        source = tried if tried.caustic or not by_radius else with_caustics
        caustic = _widened(source, "caustic", square, trier.scale, 0.0) if source is not None else NONE
        if source is not None:
            caustic = caustic.wider(tried.first.caustic / source.first.caustic)
        shown = _widened(tried, "shown", square, trier.scale, HIDDEN)
        bias = Bias(caustic.blur, shown.blur, interpolated, gathered=at_ends if tried.plan.gather else Blur())
        measured = _measured(tried, (caustic, shown), bias, square, trier.scale)
        if tried.plan.direct and with_samples is not None:
            measured = _sampled(measured, with_samples, square, trier.scale)
        measured = measured.shared(trier.kept)
        result.measured.append(replace(measured, covered=covered if _aims(tried) else 0.0))
        if tried is gathers and at_ends.bias2 > 0 and "gather.secondary" in tried.candidate.values:
            result.measured.append(_farther(result.measured[-1]))
    # A few rays of a pixel are no less noisy than records: what is less was taken for photons.
    least = min((m.eye for m in result.measured if m.candidate.values.get("gather.cache") == "on"), default=0.0)
    result.measured = [replace(m, eye=max(m.eye, least)) if m.candidate.gathers else m for m in result.measured]
    return result


def _aims(tried: Attempt) -> bool:
    """Whether photons may start for the caustic map alone: guided ones fill both maps, and where it holds light from
    diffuse surfaces, too, fewer of the others make that worse."""
    photons = tried.runs[0].settings.photons
    return bool(tried.plan.caustic_mask) and tried.plan.emission == "off" and not photons.indirect_caustics


def _covered(opened: OpenScene, settings: Settings) -> float:
    """Share of the light that photons for the caustic map alone would start in."""
    made = projection_for(opened, with_values(settings, {"photons.q": 0.5}))
    return min(made.caustic_power / made.surface_power, 1.0) if made is not None else 1.0


def _widened(tried: Attempt, name: str, square: F8, scale: float, hidden: float) -> Widened:
    """What passes with other radii of that name tell; nothing without them. hidden: as for `told_by`."""
    runs: list[Run] = getattr(tried, name)
    if not runs:
        return NONE
    wide, narrow = (Tried(run.images, run.stages.get("camera pass", 0.0)) for run in runs)
    usual = Tried(tried.runs[0].images, 0.0)
    found = told_by(wide, usual, narrow, square, hidden)
    N = tried.runs[0].N
    return replace(found, variance=found.variance * N, cost=found.cost * scale / N)


def _at_ends(gathers: Attempt, mean: F8) -> Blur:
    """What look-ups at the ends of gather rays lack, from passes with a radius WIDER times as wide: as much as that
    lacks more, with their order. In blocks, as what interpolation does."""
    more = squared(gathers.gathered[0].images, gathers.runs[0].images, mean, BLOCK)
    return Blur(more / (WIDER**GATHERED_ORDER - 1) ** 2, GATHERED_ORDER)


def _of_photons(tried: Attempt, square: F8) -> float:
    """Variance that the photons of one trajectory make, from passes with the first few of them. Where photons choose
    lights, fewer of them choose others, and pictures of the same seed differ by more than that."""
    many, few = tried.runs
    found = nested(few.looked_up, many.looked_up, square)
    if tried.plan.asks_photons:
        found = min(found, max(variance(few.looked_up, square) - variance(many.looked_up, square), 0.0))
    return found / (1 / few.N - 1 / many.N)


def _farther(gather: Measured) -> Measured:
    """What a gather that has been measured would be with second gathers farther out."""
    costs, blur = gather.costs, gather.bias.gathered
    return replace(
        gather,
        candidate=replace(gather.candidate.having(FARTHER), name=FARTHER_NAME),
        costs=replace(costs, base=MORE_COST * costs.base),
        bias=replace(gather.bias, gathered=replace(blur, bias2=LESS_BIAS * blur.bias2)),
    )


def _measured(tried: Attempt, widened: tuple[Widened, Widened], bias: Bias, square: F8, scale: float) -> Measured:
    variances = [variance(run.images, square) for run in tried.runs]
    caustic, shown = (part.variance for part in widened)
    eye, gathered = variances[0], 0.0
    if len(tried.runs) > 1:
        many = tried.runs[0]
        told = caustic + shown
        photons = min(max(_of_photons(tried, square), told), variances[0] * many.N)
        eye = variances[0] - photons / many.N
        fitting = min(1.0, photons / told) if told > 0 else 1.0
        caustic, shown = caustic * fitting, shown * fitting
        gathered = max(photons - caustic - shown, 0.0)
    costs = _costs(tried.runs, (widened[0].cost, widened[1].cost), scale)
    return Measured(tried.candidate, costs, eye, caustic, shown, RARE * gathered, bias, tried.first)


def _sampled(measured: Measured, source: Attempt, square: F8, scale: float) -> Measured:
    """With what light samples do, told by passes with `MORE` times as many and the same photons and camera rays, by the
    terms that they make: the noise of others would hide it. Samples of a pass complement one another as passes do."""
    usual, many = source.runs[-1], source.direct[0]
    complement = BY_PHOTONS if source.plan.asks_photons else BY_POWER
    direct = nested(usual.sampled, many.sampled, square) / (1 - MORE**-complement)
    spent = max(many.stages["camera pass"] - usual.stages["camera pass"], 0.0) * scale / (MORE - 1)
    costs = replace(measured.costs, sampled=spent)
    return replace(measured, direct=min(direct, MOST_DIRECT * measured.eye), complement=complement, costs=costs)


def _costs(runs: list[Run], look_ups: tuple[float, float], scale: float) -> Costs:
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
