"""Settings by the names that one writes in Python: full ones, or as short as they are unambiguous."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pmviewer.errors import SettingError
from pmviewer.settings.access import (
    SETTINGS,
    SettingInfo,
    Settings,
    info_of,
    parse_assignments,
    range_text,
    with_values,
)

MEANT = {
    "N": "photons.N",
    "k": "estimate.k",
    "passes": "render.passes",
    **{name: f"camera.{name}" for name in ("origin", "target", "up", "fov")},
}
"""Names that several settings end in, of which one is what everybody means: N photons, k of them, the camera."""


def path_of(name: str) -> str:
    """Full name of a setting: "q" → "photons.q", "caustic.show" → "overlays.caustic.show".

    Raises SettingError for a name that no setting or more than one ends in.
    """
    if name in SETTINGS:
        return name
    if name in MEANT:
        return MEANT[name]
    found = [path for path in SETTINGS if path.endswith(f".{name}")]
    if len(found) > 1:
        raise SettingError(f"'{name}' may be {' or '.join(found)}: give the full name.")
    return found[0] if found else info_of(name).path


def changed_by(settings: Settings, values: Mapping[str, Any]) -> Settings:
    """Settings with some values changed, by name. Texts are read as the command line reads them; numbers, arrays and
    scalars of NumPy are taken as such. Raises SettingError, and changes nothing then."""
    changes: dict[str, Any] = {}
    for name, value in values.items():
        path = path_of(name)
        if path in changes:
            raise SettingError(f"{path} is given twice, the second time as '{name}'.")
        changes[path] = _value(SETTINGS[path], value)
    return with_values(settings, changes)


def _value(info: SettingInfo, value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, str) and info.scale != "name":
        return parse_assignments([f"{info.path}={value}"])[info.path]
    if isinstance(value, bool) and info.kind is not bool:
        raise SettingError(f"{info.path} = {value} is not allowed: expected {range_text(info)}.")
    return tuple(value) if isinstance(value, list) else value
