"""Keys of a film: settings at times, and the settings at any time between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pmviewer.errors import SettingError
from pmviewer.settings.access import SETTINGS, Settings, get, with_values
from pmviewer.settings.between import between

LONGEST = 3600.0
"""Seconds of a film."""
EXPOSURE = "display.exposure"
_LEFT_OUT = ("region.", "overlays.", "compare.", "display.", "free_camera.", "camera.width", "camera.height")


def in_films(path: str) -> bool:
    """Whether keys change that setting: what decides about the picture, but for its size, its passes and its view."""
    return path == EXPOSURE or (SETTINGS[path].stage != "stop" and not path.startswith(_LEFT_OUT))


@dataclass(frozen=True)
class FilmKey:
    """The settings at a time `at` in seconds, of which those count that films change (`in_films`)."""

    at: float
    settings: Settings


@dataclass(frozen=True)
class FilmWay:
    """The way through keys that are completed and sorted by time (`pmviewer.engine.series.keys.film_way`)."""

    times: tuple[float, ...]
    keys: tuple[Settings, ...]
    differing: tuple[str, ...]
    """Settings that some key has otherwise than another: what the film shows."""

    def at(self, seconds: float, others: Settings) -> Settings:
        """The settings at that time; what no key changes is as in `others`. Raises SettingError as `between` does."""
        if not self.differing:
            return others
        place = float(np.interp(seconds, self.times, np.arange(len(self.times))))
        found = between(self.keys, place)
        return with_values(others, {path: get(found, path) for path in self.differing})

    def pictures(self, fps: float, others: Settings) -> list[Settings]:
        """The settings of each picture, the first and the last key among them."""
        length = self.times[-1] - self.times[0]
        count = max(round(length * fps), 1) + 1
        return [self.at(float(t), others) for t in np.linspace(self.times[0], self.times[-1], count)]


def comparable(keys: Sequence[FilmKey]) -> list[Settings]:
    """The keys' settings, alike in all that films don't change. An exposure counts where all keys have a number."""
    first = keys[0].settings
    numbers = all(key.settings.display.exposure != "auto" for key in keys)
    kept = [path for path in SETTINGS if not in_films(path) or (path == EXPOSURE and not numbers)]
    same = {path: get(first, path) for path in kept}
    return [with_values(key.settings, same) for key in keys]


def difference(key: FilmKey, before: FilmKey) -> list[str]:
    """Settings that change from one key to the next."""
    return [path for path in SETTINGS if in_films(path) and get(key.settings, path) != get(before.settings, path)]


def as_tree(keys: Sequence[FilmKey]) -> list[dict[str, Any]]:
    """Rows for a session file: the time, and by full name what is not the default."""
    rows = []
    for key in keys:
        values = {path: get(key.settings, path) for path in SETTINGS if in_films(path)}
        changed = {path: value for path, value in values.items() if value != SETTINGS[path].default}
        kept = {path: list(value) if isinstance(value, tuple) else value for path, value in changed.items()}
        rows.append({"at": key.at, "settings": kept})
    return rows


def from_tree(rows: Any) -> tuple[FilmKey, ...]:
    """The keys of such rows, by time. Raises SettingError."""
    expected = 'expected rows as [[film]] with at = 1.5 and settings, a table of names in quotes as "photons.N" = 1000'
    if not isinstance(rows, list):
        raise SettingError(f"film is not allowed as it is: {expected}.")
    found: dict[float, FilmKey] = {}
    for row in rows:
        at, values = (row.get("at"), row.get("settings", {})) if isinstance(row, dict) else (None, None)
        number = isinstance(at, int | float) and not isinstance(at, bool) and 0 <= at <= LONGEST
        if not number or not isinstance(values, Mapping) or set(row) - {"at", "settings"}:
            raise SettingError(f"film: {row!r} is not allowed: {expected}.")
        assert at is not None
        if float(at) in found:
            raise SettingError(f"film: two keys at {at} s: give each a time of its own.")
        found[float(at)] = FilmKey(float(at), with_values(Settings(), dict(values)))
    return tuple(found[at] for at in sorted(found))
