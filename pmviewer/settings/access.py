"""Reading and changing settings by name: what interfaces, command line and session files need of the schema."""

from __future__ import annotations

import functools
import operator
import types
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, Union, get_args, get_origin

from pydantic import ValidationError

from pmviewer.errors import SettingError
from pmviewer.settings import edits
from pmviewer.settings.needs import Needs
from pmviewer.settings.schema import (
    CacheOverlay,
    CameraSettings,
    CellOverlay,
    Direct,
    Display,
    Edit,
    Estimate,
    FateOverlay,
    FocusOverlay,
    FreeCamera,
    GatherOverlay,
    Group,
    Importance,
    ImportonOverlay,
    Light,
    LightOverlay,
    Overlays,
    PathOverlay,
    Photons,
    PointOverlay,
    ProjectionOverlay,
    Scale,
    Settings,
    ShadowOverlay,
    Stage,
    Virtual,
)

__all__ = [
    "SETTINGS",
    "CacheOverlay",
    "CameraSettings",
    "CellOverlay",
    "Direct",
    "Display",
    "Edit",
    "Estimate",
    "FateOverlay",
    "FocusOverlay",
    "FreeCamera",
    "GatherOverlay",
    "Importance",
    "ImportonOverlay",
    "Light",
    "LightOverlay",
    "Overlays",
    "PathOverlay",
    "Photons",
    "PointOverlay",
    "ProjectionOverlay",
    "SettingInfo",
    "Settings",
    "ShadowOverlay",
    "Stage",
    "Virtual",
    "changed_stages",
    "flat",
    "from_tree",
    "get",
    "info_of",
    "needs_of",
    "parse_assignments",
    "parse_edits",
    "range_text",
    "with_values",
]


@dataclass(frozen=True)
class SettingInfo:
    """What an interface needs to know about one setting. `path` is its full name ("photons.N"), `group` the group's
    heading, `kind` its Python type, `auto` whether "auto" is a value, `choices` the values of a choice."""

    path: str
    group: str
    title: str
    description: str
    unit: str
    scale: Scale
    stage: Stage
    kind: type
    lower: float | None
    upper: float | None
    choices: tuple[str, ...]
    auto: bool
    default: Any
    section: str
    """Heading within the group; empty for the settings before the first."""
    needs: Needs
    """What must hold for it to have an effect, in the order in which it is told."""
    choice_needs: Mapping[str, Needs]
    """What must hold for a choice to show something, of those that need something."""


def _kind_of(annotation: Any) -> tuple[type, tuple[str, ...], bool]:
    """Plain type, choices and whether "auto" is allowed, of a field's annotation."""
    origin = get_origin(annotation)
    if origin is Literal:
        return str, tuple(get_args(annotation)), False
    if origin in (Union, types.UnionType):
        plain = next(arm for arm in get_args(annotation) if get_origin(arm) is not Literal)
        kind, choices, _ = _kind_of(plain)
        return kind, choices, True
    if origin in (tuple, dict):
        return origin, (), False
    return annotation, (), False


def _infos(model: type[Group], prefix: str, heading: str, needs: Needs) -> Iterator[SettingInfo]:
    section = ""
    for name, field in model.model_fields.items():
        public = field.alias or name
        path = f"{prefix}{public}"
        extra: Any = field.json_schema_extra
        if isinstance(field.annotation, type) and issubclass(field.annotation, Group):
            inner = field.title or (field.annotation.__doc__ or public).strip()
            of_group = (*needs, *field.annotation.needs, *(extra["needs"] if extra else ()))
            yield from _infos(field.annotation, f"{path}.", inner, of_group)
            continue
        kind, choices, auto = _kind_of(field.annotation)
        section = extra["section"] or section
        yield SettingInfo(
            path=path,
            group=heading,
            title=field.title or public.replace("_", " "),
            description=field.description or "",
            unit=extra["unit"],
            scale=extra["scale"],
            stage=extra["stage"],
            kind=kind,
            lower=extra["ge"],
            upper=extra["le"],
            choices=choices,
            auto=auto,
            default=field.default,
            section=section,
            needs=(*needs, *extra["needs"]),
            choice_needs=extra["choice_needs"],
        )


SETTINGS: dict[str, SettingInfo] = {info.path: info for info in _infos(Settings, "", "", ())}
"""Every setting by its full name, in the order of the schema."""


def info_of(path: str) -> SettingInfo:
    """Raises SettingError, naming near misses, when there is no such setting."""
    if path in SETTINGS:
        return SETTINGS[path]
    import difflib

    near = difflib.get_close_matches(path, SETTINGS, n=3, cutoff=0.4)
    hint = f" Did you mean {' or '.join(near)}?" if near else ""
    raise SettingError(f"There is no setting '{path}'.{hint}")


def needs_of(path: str) -> Needs:
    """What must hold for a setting to have an effect, or for a choice of it to show something
    ("display.view=photon count"). Raises SettingError for an unknown setting."""
    name, _, choice = path.partition("=")
    info = info_of(name)
    return (*info.needs, *info.choice_needs.get(choice, ())) if choice else info.needs


def get(settings: Settings, path: str) -> Any:
    """The value of the setting with that full name."""
    return _getter(path)(settings)


@functools.cache
def _getter(path: str) -> Callable[[Settings], Any]:
    info_of(path)
    return operator.attrgetter(".".join("global_" if part == "global" else part for part in path.split(".")))


def with_values(settings: Settings, values: dict[str, Any]) -> Settings:
    """A copy with some settings changed. Raises SettingError that names setting, value and what is allowed."""
    tree = settings.model_dump(by_alias=True)
    for path, value in values.items():
        info_of(path)
        *groups, name = path.split(".")
        branch = tree
        for part in groups:
            branch = branch[part]
        branch[name] = value
    return from_tree(tree)


def from_tree(tree: dict[str, Any]) -> Settings:
    """Settings from nested dictionaries; whatever is missing has its default. Raises SettingError."""
    try:
        return Settings.model_validate(tree)
    except ValidationError as error:
        raise SettingError(_explain(error)) from None


def _explain(error: ValidationError) -> str:
    first = error.errors()[0]
    parts = [str(p) for p in first["loc"]]
    while parts and ".".join(parts) not in SETTINGS and len(parts) > 1:
        parts.pop()
    path = ".".join(parts)
    if path not in SETTINGS:
        return f"There is no setting '{'.'.join(str(p) for p in first['loc'])}'."
    info = SETTINGS[path]
    if info.scale == "edits":
        return str(first["ctx"]["error"])
    return f"{path} = {first['input']!r} is not allowed: expected {range_text(info)}."


def range_text(info: SettingInfo) -> str:
    """What the schema allows, in words."""
    if info.choices:
        return "one of " + ", ".join(info.choices)
    if info.scale == "vector":
        text = "three numbers (x, y, z)"
    elif info.scale == "edits":
        text = "edits, as in light.1.power=2; material.wall.colour=0.8, 0.2, 0.2"
    elif info.scale == "name":
        text = "a name"
    elif info.kind is bool:
        text = "true or false"
    else:
        text = f"{'a whole number' if info.kind is int else 'a number'}"
        if info.lower is not None and info.upper is not None:
            text += f" from {_number_text(info.lower)} to {_number_text(info.upper)}"
    return text + (" or auto" if info.auto else "")


def _number_text(value: float) -> str:
    """1e-05, 0.5, 64, 50,000,000"""
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:g}"


def parse_assignments(assignments: Iterable[str]) -> dict[str, Any]:
    """`key=value` texts of the command line as values for `with_values`. Raises SettingError."""
    values: dict[str, Any] = {}
    for text in assignments:
        path, separator, raw = (part.strip() for part in text.partition("="))
        if not separator:
            raise SettingError(f"'{text}' is not a setting: write name=value, for example photons.N=200000.")
        info = info_of(path)
        if info.scale == "vector" and raw != "auto":
            values[path] = tuple(part for part in raw.replace(",", " ").split())
        elif info.scale == "edits":
            values[path] = parse_edits(part for part in raw.split(";") if part.strip())
        elif info.kind is int and raw != "auto":
            values[path] = _whole_number(raw)
        else:
            values[path] = raw
    return values


def parse_edits(texts: Iterable[str]) -> dict[str, tuple[float, ...]]:
    """Edits of the scene (`pmviewer.settings.edits`) from texts like "light.lamp.power=2". Raises SettingError."""
    try:
        return edits.parse(texts)
    except ValueError as error:
        raise SettingError(str(error)) from None


def _whole_number(raw: str) -> Any:
    """2e5 and 200_000 are whole numbers too; anything else is left for the schema to refuse."""
    try:
        number = float(raw.replace("_", ""))
    except ValueError:
        return raw
    return int(number) if number.is_integer() else number


def flat(settings: Settings) -> dict[str, Any]:
    """Every setting's value by full name."""
    return {path: get(settings, path) for path in SETTINGS}


def changed_stages(before: Settings, after: Settings) -> set[Stage]:
    """Stages of the settings that differ."""
    return {info.stage for path, info in SETTINGS.items() if get(before, path) != get(after, path)}
