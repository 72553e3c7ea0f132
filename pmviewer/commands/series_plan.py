"""What a series of pictures shows, from the command line's words."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from pmviewer.commands.job import Job, load_job, overrides
from pmviewer.commands.patience import patiently, print_warnings
from pmviewer.engine.ahead.beside import beside
from pmviewer.engine.opened import OpenScene, arrangement_of, open_scene
from pmviewer.engine.series.keys import completed_keys, orbits, with_one_radius
from pmviewer.errors import SettingError
from pmviewer.progress import watched
from pmviewer.settings.access import SETTINGS, Settings, get, parse_assignments, parse_edits, with_values
from pmviewer.settings.between import between, places
from pmviewer.settings.edits import PROPERTIES, property_of

PASSES = 16
"""For each picture, unless something else is said."""
BETWEEN_KEYS = 24
SWEPT = 6
"""Pictures of a setting that goes from one value to another, unless something else is said."""
A_TURN = 72
"""Pictures of a camera's way once around."""


@dataclass(frozen=True)
class Plan:
    """The open scene, for each picture its settings and what the sheet says of it, and the job that asked for it."""

    opened: OpenScene
    pictures: tuple[Settings, ...]
    captions: tuple[str, ...]
    job: Job


@dataclass(frozen=True)
class Way:
    """How one setting or edit changes: through `values`, or evenly from the first over all to the last if it is
    `spread`."""

    name: str
    values: tuple[str, ...]
    spread: bool

    @property
    def is_edit(self) -> bool:
        """Rather than a setting."""
        return _is_edit(self.name)


def load_keys(
    sources: Sequence[str],
    words: tuple[Sequence[str], Sequence[str], Sequence[str]],
    passes: int | None,
    size: str | None,
) -> list[Job]:
    """The keys; `words` are assignments, definitions and edits. Raises PmviewerError, for several scenes too."""
    jobs = []
    for source in sources:
        job = load_job(source, *words)
        settings = with_values(job.settings, overrides(passes or PASSES, None, size, None, None))
        jobs.append(replace(job, settings=settings))
    scenes = list(dict.fromkeys(job.scene for job in jobs))
    if len(scenes) > 1:
        raise SettingError(f"The keys of a film are of one scene; these are of {scenes[0]} and {scenes[1]}.")
    return jobs


def plan_series(
    keys: Sequence[Job], vary: Sequence[str], orbit: float | None, pictures: int | None, threads: int | None
) -> Plan:
    """Open the scene and work out every picture's settings. Raises PmviewerError."""
    job, ways = keys[0], [way_of(text) for text in vary]
    if (len(keys) > 1 and orbit is not None) or not (len(keys) > 1 or ways or orbit is not None):
        raise SettingError("A series is several sessions, or one scene with --vary or --orbit: give one of them.")
    opened = opened_for(job, threads)
    settings, moves = [job.settings] * _count_of(ways, pictures, SWEPT), False
    if orbit is not None:
        count = _count_of(ways, pictures, max(2, round(abs(orbit) / 360 * A_TURN)))
        settings, moves = orbits(opened.scene, job.settings, count, orbit), True
    elif len(keys) > 1:
        assert opened.whole is not None
        of_keys = completed_keys(opened.scene, opened.whole, [key.settings for key in keys])
        count = _count_of(ways, pictures, (len(of_keys) - 1) * BETWEEN_KEYS + 1)
        settings, moves = [between(of_keys, at) for at in places(count, len(of_keys))], True
    settings = varied(settings, ways)
    if moves or all(way.name.startswith("camera.") or way.is_edit for way in ways):
        settings = with_one_radius(opened, settings)
    captions = tuple("\n".join(caption(way, one) for way in ways) for one in settings)
    if not ways:
        captions = tuple(str(number + 1) for number in range(len(settings)))
    return Plan(opened, tuple(settings), captions, job)


def opened_for(job: Job, threads: int | None) -> OpenScene:
    """The job's scene, with its warnings printed. Raises SceneError."""
    with patiently() as tell, watched(tell, threads=threads):
        opened = open_scene(job.scene, job.parameters, arrangement_of(job.settings), beside(job.settings, threads))
    print_warnings(opened.scene.warnings, opened.scene.dropped)
    return opened


def _count_of(ways: Sequence[Way], pictures: int | None, otherwise: int) -> int:
    """How many pictures there are: as many as lists have values, as many as were asked for, or `otherwise`. Raises
    SettingError."""
    lengths = sorted({len(way.values) for way in ways if not way.spread})
    if len(lengths) > 1:
        raise SettingError(f"--vary: lists of {lengths[0]} and of {lengths[-1]} values: give as many to each.")
    if lengths and pictures not in (None, lengths[0]):
        raise SettingError(f"--pictures {pictures}, but --vary lists {lengths[0]} values.")
    return lengths[0] if lengths else pictures or otherwise


def varied(settings: Sequence[Settings], ways: Sequence[Way]) -> list[Settings]:
    """The pictures' settings with all of these ways in them. Raises SettingError."""
    made = list(settings)
    for way in ways:
        for number, stop in enumerate(stops(settings[0], way, len(made))):
            values: dict[str, Any] = {way.name: get(stop, way.name)} if not way.is_edit else {}
            if way.is_edit:
                values["edit.changes"] = {**made[number].edit.changes, way.name: stop.edit.changes[way.name]}
            made[number] = with_values(made[number], values)
    return made


def stops(settings: Settings, way: Way, count: int) -> list[Settings]:
    """Settings at so many places on a way. Raises SettingError."""
    keys = [_with(settings, way.name, value) for value in way.values]
    return [between(keys, at) for at in places(count, len(keys))] if way.spread else keys


def way_of(text: str) -> Way:
    """ "photons.N=1000..1000000" or "gather.rays=4,16,64"; where values have commas of their own, semicolons part them.
    Raises SettingError."""
    name, _, raw = (part.strip() for part in text.partition("="))
    commas = _count(name) > 1
    spread = ".." in raw
    values = raw.split("..") if spread else re.split(";" if commas else ",", raw)
    values = [value.strip() for value in values]
    if not raw or not all(values):
        raise SettingError(f"--vary {text}: write NAME=FROM..TO or NAME=A,B,C, for example photons.N=1000..1000000.")
    return Way(name, tuple(values), spread)


def _count(name: str) -> int:
    """How many numbers a value of it has."""
    if not _is_edit(name):
        return 3 if name in SETTINGS and SETTINGS[name].scale == "vector" else 1
    try:
        return property_of(name).count
    except ValueError as error:
        raise SettingError(str(error)) from None


def _is_edit(name: str) -> bool:
    return name not in SETTINGS and name.split(".")[0] in PROPERTIES


def _with(settings: Settings, name: str, value: str) -> Settings:
    if _is_edit(name):
        return with_values(settings, {"edit.changes": parse_edits([f"{name}={value}"])})
    return with_values(settings, parse_assignments([f"{name}={value}"]))


def caption(way: Way, settings: Settings) -> str:
    """What is written beside a picture by these settings, of one way."""
    value = settings.edit.changes[way.name] if way.is_edit else get(settings, way.name)
    if isinstance(value, tuple):
        return f"{way.name} {', '.join(f'{v:.3g}' for v in value)}"
    if isinstance(value, int) and not isinstance(value, bool):
        return f"{way.name} {value:,}"
    return f"{way.name} {value:.4g}" if isinstance(value, float) else f"{way.name} {value}"
