"""Settings between others: what a film's pictures have whose keys are settings.

Numbers go evenly, those of a logarithmic scale by equal factors, places and directions along a smooth curve through all
keys; what is no number is the earlier key's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SettingError
from pmviewer.settings.access import SETTINGS, SettingInfo, Settings, get, with_values

Float = NDArray[np.float64]
Numbers = tuple[float, ...]


def between(keys: Sequence[Settings], at: float) -> Settings:
    """The settings at the place `at` among the keys: 0 is the first, 1 the second, 0.5 half-way.

    Raises SettingError where a key has a number and another one "auto".
    """
    at = min(max(at, 0.0), len(keys) - 1.0)
    first = min(int(at), max(len(keys) - 2, 0))
    values: dict[str, Any] = {}
    for path, info in SETTINGS.items():
        of_keys = [get(key, path) for key in keys]
        if all(value == of_keys[0] for value in of_keys):
            continue
        if info.scale == "edits":
            values[path] = _edits(of_keys, at)
        elif info.kind in (int, float, tuple):
            values[path] = of_keys[int(at)] if at == int(at) else _value(info, of_keys, at)
        else:
            values[path] = of_keys[first if at < first + 1 else first + 1]
    return with_values(keys[0], values)


def places(pictures: int, keys: int) -> list[float]:
    """Where among the keys so many pictures are, evenly from the first to the last."""
    return [float(at) for at in np.linspace(0.0, keys - 1.0, pictures)] if pictures > 1 else [0.0]


def _value(info: SettingInfo, of_keys: Sequence[Any], at: float) -> Any:
    if any(value == "auto" for value in of_keys):
        raise SettingError(f"{info.path} is a number in one key and auto in another: give it a number in both.")
    if info.kind is tuple:
        return tuple(float(v) for v in smooth(np.array(of_keys, np.float64), at))
    if info.scale == "log" and min(of_keys) > 0:
        number = float(np.exp(_even(np.log(np.array(of_keys, np.float64)), at)))
    else:
        number = float(_even(np.array(of_keys, np.float64), at))
    number = min(max(number, info.lower or 0.0), info.upper or 0.0) if info.lower is not None else number
    return round(number) if info.kind is int else number


def _edits(of_keys: Sequence[Mapping[str, Numbers]], at: float) -> dict[str, Numbers]:
    """Every key has every edit by now (`pmviewer.engine.series.keys`)."""
    found: dict[str, Numbers] = {}
    for name in dict.fromkeys(name for edits in of_keys for name in edits):
        missing = [edits for edits in of_keys if name not in edits]
        if missing:
            raise SettingError(f"{name} is edited in one key and not in another: edit it in both.")
        numbers = np.array([edits[name] for edits in of_keys], np.float64)
        curve = smooth if name.endswith((".move", ".turn")) else _even
        found[name] = tuple(float(v) for v in curve(numbers, at))
    return found


def _even(values: Float, at: float) -> Float:
    """Straight from key to key, `values` (n, …)."""
    first = min(int(at), len(values) - 2)
    share = at - first
    return np.asarray((1 - share) * values[first] + share * values[first + 1])


def smooth(points: Float, at: float) -> Float:
    """The cubic curve through points (n, k) whose tangent at each is half the way between its neighbours (Catmull and
    Rom 1974); straight for two."""
    first = min(int(at), len(points) - 2)
    t = at - first
    before = points[first - 1] if first > 0 else 2 * points[0] - points[1]
    after = points[first + 2] if first + 2 < len(points) else 2 * points[-1] - points[-2]
    start, end = points[first], points[first + 1]
    into, out = (end - before) / 2, (after - start) / 2
    return np.asarray(
        (2 * t**3 - 3 * t**2 + 1) * start
        + (t**3 - 2 * t**2 + t) * into
        + (3 * t**2 - 2 * t**3) * end
        + (t**3 - t**2) * out
    )
