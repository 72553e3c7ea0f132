"""Automatic mode: the way of rendering for a time or an error, and why it was chosen."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from pmviewer.engine.auto.bias import Bias, way_of
from pmviewer.engine.auto.candidates import CACHE_CORNERS, PROGRESSIVE, SHOWN, Candidate, candidates
from pmviewer.engine.auto.measured import Measured, Numbers, Trial, Widths
from pmviewer.engine.auto.model import BETTER, FEWEST, Option, bias_of, in_time, numbers_for, to_error
from pmviewer.engine.auto.runs import TooDearError
from pmviewer.engine.auto.size import planned
from pmviewer.engine.auto.trial import Tell, trial
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.pool import WorkPool
from pmviewer.render.adaptive import DECIDED_AFTER, WORTH
from pmviewer.render.camera import resolve_camera
from pmviewer.settings.access import SETTINGS, Settings, with_values
from pmviewer.settings.presets import assignments

SHARE, MOST_SHARE = 0.1, 0.3
"""Of the time asked for, what a trial is planned to take, and what it may: where rays go to and fro between mirrors and
metal a pixel costs ten to twenty times what is planned for, and traits choose."""
USUAL, USUAL_PASSES = 10.0, 32
"""CPU seconds that are planned for where nobody gives any, and passes of the usual numbers: a large picture is looked
at for longer, and by what is best for its first three passes it would stay bad."""
NEARLY = 1.1
"""What of the least error counts as the same."""
FEWER_PHOTONS = 1.15
"""What an error promised by fewer photons than the default number counts as: a trial does not meet the bright ones that
few pixels meet. With `NEARLY` they have to promise a fifth less. (A living room with N = 50,000: 1.8 times the error of
150,000, four seeds, where trials promised less.) Not where an error is asked for: there too few cost time and no light,
as rendering goes on. `rooms_10x10` is at 1e-2 with N = 50,000 in 0.6 of the time of 150,000."""
ADAPTIVE = {"render.adaptive": "on"}
ADAPTED = f"from pass {DECIDED_AFTER + 1} on pixels with noise of their own get more samples (render.adaptive)"
_DEFAULT = Numbers(SETTINGS["photons.N"].default)


@dataclass(frozen=True)
class Goal:
    """CPU seconds of rendering, or a relMSE; with neither a picture as good as `USUAL` seconds allow, or
    `USUAL_PASSES`. `apart`: by passes that can be rendered apart, as on a cluster."""

    seconds: float = 0.0
    error: float = 0.0
    apart: bool = False


@dataclass(frozen=True)
class Choice:
    """`values` are all settings that it sets, by full name; `changed` those that differ from the defaults. `expected`
    is the relMSE after `seconds` CPU seconds that the trial promises, NaN without one; `sentences` say why; `bias`
    gives the squared relative bias after so many passes, None without a trial."""

    name: str
    values: Mapping[str, Any]
    expected: float
    seconds: float
    sentences: tuple[str, ...]
    trial: Trial = field(default_factory=Trial)
    bias: Bias | None = None

    @property
    def changed(self) -> dict[str, Any]:
        """Those that differ from the defaults."""
        return {path: value for path, value in self.values.items() if value != SETTINGS[path].default}


def choose(opened: OpenScene, settings: Settings, goal: Goal, pool: WorkPool, tell: Tell) -> Choice:
    """What suits the scene, the camera and its picture best. `settings` give camera, size and seed; what automatic mode
    sets itself does not count. Raises Cancelled when the pool is cancelled."""
    base = with_values(settings, assignments({}))
    seconds = goal.seconds or USUAL
    found, left_out = candidates(opened.traits, base, seconds, goal.apart, plan_of(base, opened.traits).nearest)
    said = [f"not tried: {what}, {why}" for what, why in left_out]
    camera = resolve_camera(opened.scene, base.camera)
    size = planned(SHARE * seconds, len(found), camera.width, camera.height)
    if size is None or len(found) == 1:
        why = "nothing else suits the scene" if len(found) == 1 else f"{seconds:.3g} CPU s are too few for a trial"
        return _by_traits(opened, base, found, why, said)
    few, most = with_values(base, {"photons.N": size.N}), MOST_SHARE * seconds
    try:
        tried = trial(opened, few, found, pool, size[:2], SHARE * seconds, tell, most, seconds)
    except TooDearError as dear:
        why = f"a trial would take {dear.expected:.2g} CPU s, too much of {seconds:.3g}"
        return replace(_by_traits(opened, base, found, why, said), trial=dear.begun)
    if not goal.seconds:
        seconds = max(seconds, USUAL_PASSES * min(m.cost(_DEFAULT) for m in tried.measured))
    left = max(seconds - tried.cpu_seconds, SHARE * seconds)  # a trial may take longer than planned
    picked = _by_error(tried, goal.error) if goal.error else _by_time(tried, left)
    values = assignments(_values(picked, base, opened, _adapts(picked, goal)))
    bias = replace(bias_of(picked.measured, picked.numbers.widths), delay=values["estimate.delay"])
    opened.biases[way_of(with_values(base, values))] = bias  # whoever renders so knows it
    return Choice(
        picked.name,
        values,
        picked.error,
        picked.seconds,
        (
            _sentence(picked, goal),
            *picked.measured.candidate.said,
            *_reason(picked),
            *_of_passes(values),
            *_table(tried, picked),
            *said,
        ),
        tried,
        bias,
    )


def _by_traits(opened: OpenScene, base: Settings, found: list[Candidate], why: str, said: list[str]) -> Choice:
    """Without a trial, `why`: in scenes without mirrors and glass the irradiance cache, else the default method."""
    traits = opened.traits
    plain = not traits.follows(base.photons.glossy) and traits.has_diffuse and not traits.lit_media
    suits = CACHE_CORNERS if plain and not traits.glossy_roughness else PROGRESSIVE
    way = next(candidate for candidate in found if candidate.is_like(suits))
    return Choice(way.name, assignments(way.values), math.nan, 0.0, (f"{way.name}: {why}", *way.said, *said))


def _by_time(tried: Trial, seconds: float) -> Option:
    """The least error after that time; the default unless another is clearly better."""
    every = [option for m in tried.measured for option in _in_time(m, seconds)]
    enough = [option for option in every if option.passes >= FEWEST]
    if not enough:
        return max(every, key=lambda option: option.passes)
    return _picked(enough, lambda option: option.error, FEWER_PHOTONS, SHOWN)


def _by_error(tried: Trial, error: float) -> Option:
    """The least time that is expected to that error; where none reaches it, what comes nearest in a long time."""
    every = [option for m in tried.measured for option in _to_error(m, error)]
    reached = [o for o in every if math.isfinite(o.seconds)]
    return _picked(reached, lambda option: option.expected) if reached else _by_time(tried, 1000.0)


def _in_time(m: Measured, seconds: float) -> list[Option]:
    return [in_time(m, numbers, seconds) for numbers in numbers_for(m, lambda n: in_time(m, n, seconds).error)]


def _to_error(m: Measured, error: float) -> list[Option]:
    return [to_error(m, numbers, error) for numbers in numbers_for(m, lambda n: to_error(m, n, error).expected)]


def _picked(found: list[Option], promised: Callable[[Option], float], fewer: float = 1.0, shown: float = 1.0) -> Option:
    """The one that promises least, fewer photons than usual being counted `fewer` times, and photons shown directly
    `shown` times. Where that is a gather, it is the one that promises least with the bias that a trial overlooks
    (`Candidate.overlooked`), unless what does not gather then promises less. Of its candidate the numbers that
    `_preference` likes best among those that are hardly worse: those of two trials are then the same more often. The
    default unless another is clearly better."""

    def of(option: Option) -> float:
        few = option.numbers.N < _DEFAULT.N
        return promised(option) * (fewer if few else 1.0) * (shown if option.measured.candidate.shows else 1.0)

    best = min(found, key=of)
    if best.measured.candidate.gathers:
        gathers = [o for o in found if o.measured.candidate.gathers]
        sure = min(gathers, key=lambda o: of(o) * o.measured.candidate.overlooked)
        best = min([sure, *(o for o in found if not o.measured.candidate.gathers)], key=of)
    near = [o for o in found if o.measured is best.measured and of(o) <= NEARLY * of(best)]
    best = min(near, key=_preference)
    usual = next((o for o in found if _is_default(o)), None)
    return usual if usual is not None and of(best) > BETTER * of(usual) else best


def _preference(option: Option) -> float:
    """The less, the sooner among what promises the same: N and q near the defaults, and narrow radii. Bias is what a
    trial knows least, and no pass takes it away."""
    N, widths, q = option.numbers.N, option.numbers.widths, option.numbers.q
    off = abs(math.log(N / float(SETTINGS["photons.N"].default))) + abs(math.log(q))
    return off + 2 * (math.log(widths.caustic) + math.log(widths.shown))


def _is_default(option: Option) -> bool:
    return option.measured.candidate.is_like(PROGRESSIVE) and option.numbers == _DEFAULT


def _of_passes(values: Mapping[str, Any]) -> list[str]:
    """What changes from pass to pass, or waits with it."""
    lines, delay = list[str](), values["estimate.delay"]
    if delay:
        lines.append(f"look-ups stay about as wide as in the first pass for {delay:,} passes (estimate.delay)")
    if values["render.adaptive"] == "on":
        lines.append(ADAPTED)
    return lines


def _adapts(picked: Option, goal: Goal) -> bool:
    """Whether there are passes enough for adaptive samples; without a goal somebody watches as long as they like."""
    return not goal.apart and (picked.passes >= WORTH or not (goal.seconds or goal.error))


def _values(picked: Option, base: Settings, opened: OpenScene, adapts: bool) -> dict[str, Any]:
    """The settings that the option stands for, with adaptive samples where they suit the method."""
    values, numbers = dict(picked.measured.candidate.values), picked.numbers
    with_photons = with_values(base, assignments(values))
    if with_photons.render.method != "path":
        values |= {"photons.N": numbers.N, "photons.q": numbers.q, "estimate.delay": picked.delay}
    if numbers.samples != 1:
        values["direct.samples"] = numbers.samples * plan_of(with_photons, opened.traits).light_samples
    values |= numbers.widths.values(with_photons, picked.measured.first)
    if adapts:
        adapted = with_values(base, assignments(values | ADAPTIVE))
        if plan_of(adapted, opened.traits).adaptive:
            values |= ADAPTIVE
    return values


def _sentence(picked: Option, goal: Goal) -> str:
    numbers = picked.numbers
    width = "" if numbers.widths.alike else f", {_in_words(numbers.widths)}"
    photons = f", N = {numbers.N:,}" if picked.measured.photons > 0 else ""
    photons += f", q = {numbers.q:g}" if numbers.q != 1.0 else ""
    photons += f", {numbers.samples} times the light samples" if numbers.samples != 1 else ""
    if goal.error and math.isfinite(picked.seconds):
        promise = f"relMSE {goal.error:.2g} expected after {picked.seconds:.3g} CPU s"
    else:
        promise = f"relMSE {picked.error:.2g} expected after {picked.seconds:.3g} CPU s"
    return f"{picked.name}{photons}{width}: {promise}"


def _in_words(widths: Widths) -> str:
    if widths.caustic == widths.shown:
        return f"radius {widths.shown:.2g} times the automatic one"
    parts = [("caustics' radius", widths.caustic), ("global map's radius", widths.shown)]
    return ", ".join(f"{name} {width:.2g} times the automatic one" for name, width in parts if width != 1.0)


def _reason(picked: Option) -> list[str]:
    """Why other radii than the automatic ones."""
    if picked.numbers.widths.alike or not math.isfinite(picked.seconds):
        return []
    m, lines = picked.measured, list[str]()
    usual = in_time(m, replace(picked.numbers, widths=Widths()), picked.seconds)
    for what, option in (("the automatic radius", usual), ("this one", picked)):
        passes = max(option.passes, 1.0)
        bias2 = float(replace(bias_of(m, option.numbers.widths), delay=option.delay)(passes))
        lines.append(f"{what}: relMSE {option.error:.2g} in that time, {bias2:.2g} of it bias")
    return lines


def _table(tried: Trial, picked: Option) -> list[str]:
    """Each candidate at its best, for the log."""
    lines = []
    for m in tried.measured:
        if math.isfinite(picked.seconds):
            every = _in_time(m, picked.seconds)
            best = min((o for o in every if o.passes >= 1), default=every[0], key=lambda o: o.error)
            lines.append(f"tried {m.candidate.name}: relMSE {best.error:.2g} with N = {best.numbers.N:,} in that time")
    lines.append(f"trial: {tried.pixels:,} pixels, {tried.seeds} seeds, {tried.cpu_seconds:.2g} CPU s")
    return lines
