"""What to open: a scene with settings, from the command line's words. Light to import: the window waits for it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from pmviewer.errors import SettingError
from pmviewer.output.session_file import read_session
from pmviewer.settings import Settings, parse_assignments, with_values


@dataclass(frozen=True)
class Job:
    """A scene to open, with settings. `passes` is what a session file had rendered, None for a plain scene."""

    scene: str
    settings: Settings
    parameters: Mapping[str, str] = field(default_factory=dict)
    passes: int | None = None


def load_job(source: str, assignments: Iterable[str], defines: Iterable[str]) -> Job:
    """A job from a scene or a session file (.toml). Raises SettingError and SceneError."""
    parameters = dict(_definition(text) for text in defines)
    values = parse_assignments(assignments)
    if source.lower().endswith(".toml"):
        session = read_session(Path(source))
        settings = with_values(session.settings, values)
        return Job(str(session.scene), settings, {**session.parameters, **parameters}, session.passes)
    return Job(source, with_values(Settings(), values), parameters)


def _definition(text: str) -> tuple[str, str]:
    name, separator, value = text.partition("=")
    if not separator or not name:
        raise SettingError(f"'{text}' defines nothing: write name=value, for example -D res=512.")
    return name, value
