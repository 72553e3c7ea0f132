"""Every combination of some settings, from the command line's words."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from pmviewer.commands.job import Job, load_job, overrides
from pmviewer.commands.series_plan import PASSES, Plan, Way, caption, opened_for, stops, way_of
from pmviewer.errors import SettingError
from pmviewer.settings.access import Settings, get, with_values

MOST = 10_000
"""Pictures of a sweep: more are a slip of the pen."""


@dataclass(frozen=True)
class Sweep:
    """The pictures of all combinations, row by row; what stands beside the rows and above the columns of the sheet; the
    `names` of what varies, and for each picture their `values`."""

    plan: Plan
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    names: tuple[str, ...]
    values: tuple[tuple[Any, ...], ...]


def load_sweep(
    source: str,
    words: tuple[Sequence[str], Sequence[str], Sequence[str]],
    passes: int | None,
    seconds: float | None,
    size: str | None,
) -> Job:
    """The job; `words` are assignments, definitions and edits. Raises PmviewerError."""
    job = load_job(source, *words)
    passes = None if seconds is not None else passes or PASSES
    return replace(job, settings=with_values(job.settings, overrides(passes, seconds, size, None, None)))


def plan_sweep(job: Job, vary: Sequence[str], steps: int, threads: int | None) -> Sweep:
    """Open the scene and work out every picture's settings. Raises PmviewerError."""
    ways = [way_of(text) for text in vary]
    names = tuple(way.name for way in ways)
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise SettingError(f"--vary {twice[0]} is given twice: all values of a setting stand in one of them.")
    counts = [steps if way.spread else len(way.values) for way in ways]
    if math.prod(counts) > MOST:
        raise SettingError(f"These are {math.prod(counts):,} combinations: ask for at most {MOST:,}.")
    along = [stops(job.settings, way, count) for way, count in zip(ways, counts, strict=True)]
    combinations = list(itertools.product(*along))
    pictures = [_combined(job.settings, ways, combination) for combination in combinations]
    captions = [[caption(way, stop) for stop in some] for way, some in zip(ways, along, strict=True)]
    rows = tuple("\n".join(words) for words in itertools.product(*captions[:-1]))
    values = tuple(tuple(_value(way, one) for way in ways) for one in pictures)
    plan = Plan(opened_for(job, threads), tuple(pictures), tuple("" for _ in pictures), job)
    return Sweep(plan, rows, tuple(captions[-1]), names, values)


def _combined(settings: Settings, ways: Sequence[Way], stops_: Sequence[Settings]) -> Settings:
    """Settings with each way's value from its own stop. Raises SettingError."""
    values: dict[str, Any] = {}
    edits = dict(settings.edit.changes)
    for way, stop in zip(ways, stops_, strict=True):
        if way.is_edit:
            edits[way.name] = stop.edit.changes[way.name]
        else:
            values[way.name] = get(stop, way.name)
    return with_values(settings, {**values, "edit.changes": edits})


def _value(way: Way, settings: Settings) -> Any:
    """A number or a text."""
    value = settings.edit.changes[way.name] if way.is_edit else get(settings, way.name)
    if isinstance(value, tuple):
        return " ".join(f"{part:.6g}" for part in value) if len(value) > 1 else value[0]
    return str(value).lower() if isinstance(value, bool) else value
