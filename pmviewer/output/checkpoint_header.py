"""What a checkpoint tells of itself, without its arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pmviewer.errors import SceneError, SettingError
from pmviewer.output.array_file import read_about
from pmviewer.settings.access import SETTINGS, Settings, flat, with_values

FORMAT = 1
SUFFIX = ".checkpoint"
KIND = "checkpoint"


@dataclass(frozen=True)
class Header:
    """`passes` and `seconds` are rendered; `when` (seconds of the epoch) is the time of the state. `settings` are those
    of the film, `asked` those before automatic mode has chosen, which took `trial_seconds`; `program` and `hashes`
    tell whether another renderer may go on (`pmviewer.engine.checkpoint.identity`)."""

    scene: str
    scene_name: str
    parameters: Mapping[str, str]
    passes: int
    seconds: float
    width: int
    height: int
    when: float
    settings: Settings
    asked: Settings
    trial_seconds: float
    program: Mapping[str, str]
    hashes: Mapping[str, str]

    @property
    def automatic(self) -> bool:
        """Whether automatic mode has chosen settings."""
        return self.settings != self.asked

    def tree(self) -> dict[str, Any]:
        """As JSON holds it."""
        tree = {name: getattr(self, name) for name in self.__dataclass_fields__}
        both = {"settings": flat(self.settings), "asked": flat(self.asked)}
        return {"kind": f"pmviewer {KIND}", "format": FORMAT, **tree, **both}


_TYPES: dict[str, type | tuple[type, ...]] = {
    "scene": str,
    "scene_name": str,
    "parameters": dict,
    "passes": int,
    "seconds": (int, float),
    "width": int,
    "height": int,
    "when": (int, float),
    "settings": dict,
    "asked": dict,
    "trial_seconds": (int, float),
    "program": dict,
    "hashes": dict,
}


def header_of(about: Mapping[str, Any], path: str | Path) -> Header:
    """The header of a file (`pmviewer.output.array_file`). Raises SceneError where it is of something else, or of a
    program that writes other ones."""
    if about.get("kind") != f"pmviewer {KIND}":
        raise SceneError(f"This is no {KIND} of pmviewer.", path)
    if about.get("format") != FORMAT:
        found = about.get("format")
        raise SceneError(f"This is a {KIND} of format {found!r}, and this program reads format {FORMAT}.", path)
    for name, kind in _TYPES.items():
        if not isinstance(about.get(name), kind):
            raise SceneError(f"This is no whole {KIND}: {name} is missing.", path)
    program = about["program"]
    if not {"version", "sources"} <= program.keys():
        raise SceneError(f"This is no whole {KIND}: program is missing.", path)
    told = {name: about[name] for name in _TYPES}
    return Header(**{**told, "settings": _settings(told, "settings", path), "asked": _settings(told, "asked", path)})


def _settings(told: Mapping[str, Any], name: str, path: str | Path) -> Settings:
    """Those of this program; another one may have others."""
    values, version = told[name], told["program"]["version"]
    strange = [setting for setting in values if setting not in SETTINGS]
    try:
        if strange:
            raise SettingError(f"There is no setting '{strange[0]}'.")
        return with_values(Settings(), values)
    except SettingError as error:
        hint = "Go on with that version."
        raise SceneError(f"This {KIND} was made by pmviewer {version}: {error}", path, hint=hint) from None


def read_header(path: str | Path) -> Header:
    """What a checkpoint tells of itself. Raises SceneError."""
    return header_of(read_about(path, KIND), path)
