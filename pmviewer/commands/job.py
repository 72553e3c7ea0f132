"""What to open: a scene with settings, from the command line's words. Light to import: the window waits for it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from pmviewer.errors import OutputError, SceneError, SettingError
from pmviewer.output.session_file import read_session
from pmviewer.settings.access import Settings, parse_assignments, parse_edits, with_values

DEFAULT_PASSES = 64


@dataclass(frozen=True)
class Job:
    """A scene to open, with settings. `passes` is what a session file had rendered, None for a plain scene."""

    scene: str
    settings: Settings
    parameters: Mapping[str, str] = field(default_factory=dict)
    passes: int | None = None
    snapshots: tuple[tuple[int, Path], ...] = ()
    """Numbers and files of a session file's snapshots, which the window alone reads."""
    told: tuple[str, ...] = ()
    """Full names of the settings that the command line gives, defaults among them."""


def load_job(source: str, assignments: Iterable[str], defines: Iterable[str], edits: Iterable[str] = ()) -> Job:
    """A job from a scene or a session file (.toml). Edits come on top of the file's. Raises SettingError and
    SceneError."""
    parameters = dict(_definition(text) for text in defines)
    values = parse_assignments(assignments)
    changes = {**values.get("edit.changes", {}), **parse_edits(edits)}
    if changes:
        values["edit.changes"] = changes
    if source.lower().endswith(".toml"):
        session = read_session(Path(source))
        if changes:
            values["edit.changes"] = {**session.settings.edit.changes, **changes}
        settings = with_values(session.settings, values)
        given = {**session.parameters, **parameters}
        return Job(str(session.scene), settings, given, session.passes, session.snapshots, tuple(values))
    return Job(source, with_values(Settings(), values), parameters, told=tuple(values))


def with_snapshots(job: Job, paths: Iterable[Path]) -> Job:
    """The job with more pictures as snapshots, numbered on. Raises SceneError for a file that isn't there."""
    numbered = list(job.snapshots)
    for path in paths:
        if not path.is_file():
            raise SceneError("There is no such picture to open as a snapshot.", path)
        numbered.append((1 + max((number for number, _ in numbered), default=0), path))
    return replace(job, snapshots=tuple(numbered))


def _definition(text: str) -> tuple[str, str]:
    name, separator, value = text.partition("=")
    if not separator or not name:
        raise SettingError(f"'{text}' defines nothing: write name=value, for example -D res=512.")
    return name, value


@dataclass(frozen=True)
class Stop:
    """When a rendering stops: after passes, after seconds, at an estimated error (relMSE); and whether automatic mode
    chooses how it renders, None for where that suits."""

    passes: int | None = None
    seconds: float | None = None
    error: float | None = None
    auto: bool | None = None


def overrides(
    passes: int | None,
    seconds: float | None,
    size: str | None,
    seed: int | None,
    session_passes: int | None,
    error: float | None = None,
) -> dict[str, object]:
    """Settings by the command line's other options. Raises SettingError."""
    values: dict[str, object] = {}
    if error is not None:
        values["render.error"] = error
    if seconds is not None or error is not None:
        values["render.time_limit"] = seconds or 0.0
        values["render.passes"] = 1_000_000
    else:
        values["render.passes"] = passes or session_passes or DEFAULT_PASSES
        values["render.time_limit"] = 0.0
    if size is not None:
        match = re.fullmatch(r"\s*(\d{1,6})\s*[xX×]\s*(\d{1,6})\s*", size)
        if not match:
            raise SettingError(f"--size {size} is not a size: write WIDTHxHEIGHT, for example 1280x720.")
        values["camera.width"], values["camera.height"] = int(match[1]), int(match[2])
    if seed is not None:
        values["render.seed"] = seed
    return values


def check_output(path: Path, formats: tuple[str, ...]) -> None:
    """Raises OutputError where no file of these formats can be written."""
    if path.suffix.lower() not in formats:
        raise OutputError(f"{path}: unknown format '{path.suffix}'. Use {' or '.join(formats)}.")
    if not path.absolute().parent.is_dir():
        raise OutputError(f"{path}: the folder {path.absolute().parent} does not exist. Create it first.")
